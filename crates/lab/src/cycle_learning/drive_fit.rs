//! Identification of the servo drive: dead time, lag and damping from commanded and measured motor speed, by least squares.
//!
//! The recursive identification in the control period (`DriveIdentification`) has one first-order lag; here dead time and lag are told apart.

use super::delayed_drive::DelayedDrive;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::{Numbers, Tuning};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DVector, Dyn, OMatrix, U3, Vector3, storage::Owned};
use std::f64::consts::TAU;

/// Starts of the search: total delays as shares of the known one, each divided in so many parts between lag and dead time; the best of them is taken.
const SHARES: [f64; 5] = [0.4, 0.6, 0.8, 1.0, 1.2];
const PARTS: u32 = 8;
/// Steps of the difference quotients, and units, of dead time \[s\], lag \[s\] and damping ratio.
const STEPS: [f64; 3] = [1e-4, 1e-4, 0.02];
/// A lag shorter than this \[s\] is taken as zero.
const PROMPT: f64 = 1e-4;
/// Range of the damping ratio.
const DAMPED: [f64; 2] = [0.3, 2.0];

/// The numbers with the total delay, bandwidth and damping of least squared difference to the measured speed; unchanged where nothing moved, but for a damping ratio outside [`DAMPED`].
pub(crate) fn fitted_drive(
    numbers: &Numbers<f64>,
    commands: &[AxisCommand<f64>],
    readings: &[AxisSignals<f64>],
) -> Numbers<f64> {
    let with = |dead: f64, lag: f64| {
        let moved = Vector3::new(dead / STEPS[0], lag / STEPS[1], numbers.drive_damping / STEPS[2]);
        DriveFit { numbers, commands, readings, moved }
    };
    let delay = numbers.tuning.estimator_drive_lag;
    let drive = (numbers.drive_bandwidth > 0.0)
        .then(|| 2.0 * numbers.drive_damping / (TAU * numbers.drive_bandwidth));
    let drive = drive.unwrap_or(0.0).min(delay);
    let others = SHARES.into_iter().flat_map(|share| {
        (0..=PARTS).map(move |part| {
            let lag = f64::from(part) / f64::from(PARTS) * share * delay;
            (share * delay - lag, lag)
        })
    });
    // what is known first: so it stays where others are no better
    let mut nearest = with(delay - drive, drive);
    let mut least = nearest.residuals_at(&nearest.moved).norm_squared();
    for (dead, lag) in others {
        let other = with(dead, lag);
        let squares = other.residuals_at(&other.moved).norm_squared();
        if squares < least {
            (nearest, least) = (other, squares);
        }
    }
    let (found, _) = LevenbergMarquardt::new().with_scale_diag(false).minimize(nearest);
    found.motor(&found.moved)
}

/// The least-squares problem.
struct DriveFit<'a> {
    numbers: &'a Numbers<f64>,
    commands: &'a [AxisCommand<f64>],
    readings: &'a [AxisSignals<f64>],
    /// Dead time, lag and damping ratio, in units of [`STEPS`].
    moved: Vector3<f64>,
}

impl DriveFit<'_> {
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

    /// Speed of the model less the measured one \[rev/s\].
    fn residuals_at(&self, moved: &Vector3<f64>) -> DVector<f64> {
        let mut motor = DelayedDrive::new(&self.motor(moved));
        let faster = self.commands.iter().zip(self.readings).map(|(command, reading)| {
            let faster = motor.speed() - reading.motor_speed;
            motor.advance(command.motor_speed);
            faster
        });
        DVector::from_iterator(self.commands.len().min(self.readings.len()), faster)
    }
}

impl LeastSquaresProblem<f64, Dyn, U3> for DriveFit<'_> {
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
        Some(self.residuals_at(&self.moved))
    }

    fn jacobian(&self) -> Option<OMatrix<f64, Dyn, U3>> {
        let here = self.residuals_at(&self.moved);
        let slopes = std::array::from_fn::<_, 3, _>(|k| {
            let mut moved = self.moved;
            moved[k] += 1.0;
            self.residuals_at(&moved) - &here
        });
        Some(OMatrix::<f64, Dyn, U3>::from_columns(&slopes))
    }
}

#[cfg(test)]
mod tests {
    use super::super::experiment::at_rest;
    use super::*;
    use crate::closed_loop::monte_carlo::member;
    use crate::closed_loop::scenario::CourseChoice;
    use hydroboom_description::Description;

    /// Speeds between which the motor leaps farther than its slew lets it, as with noise.
    fn commands(scale: f64) -> Vec<AxisCommand<f64>> {
        let leaping = |k: u32| {
            let motor_speed = scale * f64::sin(1e-4 * f64::from(k * k % 9001));
            AxisCommand { motor_speed, holding_valve: 1.0 }
        };
        (0..2000).map(leaping).collect()
    }

    fn measured(numbers: &Numbers<f64>, commands: &[AxisCommand<f64>]) -> Vec<AxisSignals<f64>> {
        let mut motor = DelayedDrive::new(numbers);
        let reading = |command: &AxisCommand<f64>| {
            let motor_speed = motor.speed();
            motor.advance(command.motor_speed);
            AxisSignals { motor_speed, ..AxisSignals::default() }
        };
        commands.iter().map(reading).collect()
    }

    /// All lag, half of it, and none; from 1.5 times the true delay, and the damping of the crane file.
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
            let commands = commands(20.0);
            let mut late_tuning = believed.tuning;
            late_tuning.estimator_drive_lag = 1.5 * numbers.tuning.estimator_drive_lag;
            let late = Numbers { tuning: late_tuning, ..believed };
            let found = fitted_drive(&late, &commands, &measured(&numbers, &commands));
            let each = |n: &Numbers<f64>| {
                [n.tuning.estimator_drive_lag, n.drive_bandwidth, n.drive_damping]
            };
            for (found, there) in each(&found).into_iter().zip(each(&numbers)) {
                assert!((found - there).abs() <= 1e-3 * there, "{found} for {there}, {share}");
            }
        }
    }

    /// One that turns in steps of a quarter of a millisecond, against the load, behind a fieldbus. The commands jump beyond the slew rate, as measurement noise makes them.
    #[test]
    fn the_drive_of_a_virtual_crane_is_found() {
        let model = Description::uia_single_boom().unwrap();
        let crane = member(&Description::uia_virtual().unwrap(), 1, 142).unwrap().crane;
        let n = &crane.numbers;
        let course = CourseChoice::Motion(n.fast).of(&crane).unwrap();
        let mut machine = at_rest(&crane, course.as_ref()).unwrap();
        let commands = commands(10.0);
        let reading = |command: &AxisCommand<f64>| {
            let reading = machine.signals();
            machine.advance(command).unwrap();
            reading
        };
        let readings: Vec<_> = commands.iter().map(reading).collect();
        let found = fitted_drive(&model.numbers, &commands, &readings);
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
        let commands = commands(0.0);
        let found = fitted_drive(&numbers, &commands, &measured(&numbers, &commands));
        assert_eq!(found, numbers);
    }
}
