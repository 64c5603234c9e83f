//! How late a motor is, and what of it is the lag of its drive: as what it was told and what it was read to turn share them out.
//!
//! The identification in the control period (`DriveIdentification`) knows a first-order lag only; here its dead time is told apart.

use crate::late_motor::LateMotor;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::{Numbers, Tuning};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DVector, Dyn, OMatrix, U3, Vector3, storage::Owned};
use std::f64::consts::TAU;

/// The search begins where it is best of lateness that is these shares of what is known, each in so many parts shared between lag and dead time.
const SHARES: [f64; 5] = [0.4, 0.6, 0.8, 1.0, 1.2];
const PARTS: u32 = 8;
/// What dead time \[s\], lag \[s\] and damping ratio are moved by for their slopes, and counted in.
const STEPS: [f64; 3] = [1e-4, 1e-4, 0.02];
/// A lag shorter than this \[s\] is none.
const PROMPT: f64 = 1e-4;
/// Damping ratios of drives.
const DAMPED: [f64; 2] = [0.3, 2.0];

/// The numbers with the lateness, the drive's bandwidth and its damping that come nearest to the speeds that were read; with those that they have where nothing moved.
pub(crate) fn motor_as_read(
    numbers: &Numbers<f64>,
    told: &[AxisCommand<f64>],
    read: &[AxisSignals<f64>],
) -> Numbers<f64> {
    let beside = |dead: f64, lag: f64| {
        let moved = Vector3::new(dead / STEPS[0], lag / STEPS[1], numbers.drive_damping / STEPS[2]);
        Beside { numbers, told, read, moved }
    };
    let late = numbers.tuning.estimator_drive_lag;
    let drive = (numbers.drive_bandwidth > 0.0)
        .then(|| 2.0 * numbers.drive_damping / (TAU * numbers.drive_bandwidth));
    let drive = drive.unwrap_or(0.0).min(late);
    let others = SHARES.into_iter().flat_map(|share| {
        (0..=PARTS).map(move |part| {
            let lag = f64::from(part) / f64::from(PARTS) * share * late;
            (share * late - lag, lag)
        })
    });
    // what is known first: so it stays where others are no better
    let mut nearest = beside(late - drive, drive);
    let mut least = nearest.faster(&nearest.moved).norm_squared();
    for (dead, lag) in others {
        let other = beside(dead, lag);
        let squares = other.faster(&other.moved).norm_squared();
        if squares < least {
            (nearest, least) = (other, squares);
        }
    }
    let (found, _) = LevenbergMarquardt::new().with_scale_diag(false).minimize(nearest);
    found.motor(&found.moved)
}

/// A motor beside what was read of one.
struct Beside<'a> {
    numbers: &'a Numbers<f64>,
    told: &'a [AxisCommand<f64>],
    read: &'a [AxisSignals<f64>],
    /// Dead time, lag and damping ratio, in [`STEPS`].
    moved: Vector3<f64>,
}

impl Beside<'_> {
    fn motor(&self, moved: &Vector3<f64>) -> Numbers<f64> {
        let [dead, lag, damping] = std::array::from_fn(|k| STEPS[k] * moved[k]);
        let (dead, lag) = (dead.max(0.0), lag.max(0.0));
        let damping = damping.clamp(DAMPED[0], DAMPED[1]);
        let bandwidth = if lag < PROMPT { 0.0 } else { 2.0 * damping / (TAU * lag) };
        let lead = if lag < PROMPT { dead } else { dead + lag };
        Numbers {
            tuning: Tuning { estimator_drive_lag: lead, ..self.numbers.tuning },
            drive_bandwidth: bandwidth,
            drive_damping: damping,
            ..*self.numbers
        }
    }

    /// How much faster one so moved turns than was read \[rev/s\].
    fn faster(&self, moved: &Vector3<f64>) -> DVector<f64> {
        let mut motor = LateMotor::new(&self.motor(moved));
        let faster = self.told.iter().zip(self.read).map(|(told, read)| {
            let faster = motor.speed() - read.motor_speed;
            motor.told(told.motor_speed);
            faster
        });
        DVector::from_iterator(self.told.len().min(self.read.len()), faster)
    }
}

impl LeastSquaresProblem<f64, Dyn, U3> for Beside<'_> {
    type ParameterStorage = Owned<f64, U3>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, U3>;

    fn set_params(&mut self, moved: &Vector3<f64>) {
        self.moved = *moved;
    }

    fn params(&self) -> Vector3<f64> {
        self.moved
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        Some(self.faster(&self.moved))
    }

    fn jacobian(&self) -> Option<OMatrix<f64, Dyn, U3>> {
        let here = self.faster(&self.moved);
        let slopes = std::array::from_fn::<_, 3, _>(|k| {
            let mut moved = self.moved;
            moved[k] += 1.0;
            self.faster(&moved) - &here
        });
        Some(OMatrix::<f64, Dyn, U3>::from_columns(&slopes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closed_loop::monte_carlo::member;
    use crate::closed_loop::scenario::CourseChoice;
    use crate::learning::at_rest;
    use hydroboom_description::Description;

    /// Speeds between which the motor leaps farther than its slew lets it, as with noise.
    fn told(scale: f64) -> Vec<AxisCommand<f64>> {
        let leaping = |k: u32| {
            let motor_speed = scale * f64::sin(1e-4 * f64::from(k * k % 9001));
            AxisCommand { motor_speed, holding_valve: 1.0 }
        };
        (0..2000).map(leaping).collect()
    }

    fn read(numbers: &Numbers<f64>, told: &[AxisCommand<f64>]) -> Vec<AxisSignals<f64>> {
        let mut motor = LateMotor::new(numbers);
        let reading = |told: &AxisCommand<f64>| {
            let motor_speed = motor.speed();
            motor.told(told.motor_speed);
            AxisSignals { motor_speed, ..AxisSignals::default() }
        };
        told.iter().map(reading).collect()
    }

    /// All lag, half of it, and none; from a lateness that is half as much again, and the damping of the crane file.
    #[test]
    fn what_is_read_of_a_motor_tells_its_drive() {
        let believed = Description::uia_single_boom().unwrap().numbers;
        for (share, damping) in [(1.0, 0.7), (0.5, 1.1), (0.0, believed.drive_damping)] {
            let mut numbers = Numbers { drive_damping: damping, ..believed };
            numbers.tuning.estimator_drive_lag = 9e-3;
            if share > 0.0 {
                let lag = share * numbers.tuning.estimator_drive_lag;
                numbers.drive_bandwidth = 2.0 * damping / (TAU * lag);
            }
            let told = told(20.0);
            let mut late_tuning = believed.tuning;
            late_tuning.estimator_drive_lag = 1.5 * numbers.tuning.estimator_drive_lag;
            let late = Numbers { tuning: late_tuning, ..believed };
            let found = motor_as_read(&late, &told, &read(&numbers, &told));
            let each = |n: &Numbers<f64>| {
                [n.tuning.estimator_drive_lag, n.drive_bandwidth, n.drive_damping]
            };
            for (found, there) in each(&found).into_iter().zip(each(&numbers)) {
                assert!((found - there).abs() <= 1e-3 * there, "{found} for {there}, {share}");
            }
        }
    }

    /// One that turns in steps of a quarter of a millisecond, against the load, behind a fieldbus. Told to leap, as under the noise of what is read.
    #[test]
    fn the_drive_of_a_virtual_crane_is_found() {
        let model = Description::uia_single_boom().unwrap();
        let crane = member(&Description::uia_virtual().unwrap(), 1, 142).unwrap().crane;
        let n = &crane.numbers;
        let course = CourseChoice::Motion(n.fast).of(&crane).unwrap();
        let mut machine = at_rest(&crane, course.as_ref()).unwrap();
        let told = told(10.0);
        let reading = |told: &AxisCommand<f64>| {
            let reading = machine.signals();
            machine.advance(told).unwrap();
            reading
        };
        let read: Vec<_> = told.iter().map(reading).collect();
        let found = motor_as_read(&model.numbers, &told, &read);
        let drive = 2.0 * n.drive_damping / (TAU * n.drive_bandwidth);
        let late = drive + 2.0 * n.fieldbus_delay * n.control_period;
        for (found, there) in [
            (found.drive_bandwidth, n.drive_bandwidth),
            (found.drive_damping, n.drive_damping),
            (found.tuning.estimator_drive_lag, late),
        ] {
            assert!((found - there).abs() < 0.02 * there, "{found} for {there}");
        }
    }

    #[test]
    fn a_motor_that_rests_stays_as_it_is_known() {
        let numbers = Description::uia_single_boom().unwrap().numbers;
        let told = told(0.0);
        let found = motor_as_read(&numbers, &told, &read(&numbers, &told));
        assert_eq!(found, numbers);
    }
}
