//! Position and load pressure along a log, sample by sample, as input of the filter.

use super::filter_run::Source;
use hydroboom_control::estimation::extended_kalman_filter::EstimatorInput;
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_measurement::Track;

/// Iterator over the samples of a signal.
struct Samples<'a> {
    track: &'a Track,
    next: usize,
}

impl<'a> Samples<'a> {
    fn new(track: &'a Track, from: f64) -> Self {
        Self { track, next: track.time().partition_point(|t| *t < from) }
    }

    /// Time and value of the newest unused sample up to a time \[s\].
    fn newest(&mut self, until: f64) -> Option<(f64, f64)> {
        let before = self.next;
        while self.track.time().get(self.next).is_some_and(|t| *t <= until) {
            self.next += 1;
        }
        let last = self.next.checked_sub(1).filter(|_| self.next > before)?;
        Some((self.track.time()[last], self.track.values()[last]))
    }
}

/// Samples of position and load pressure that are new in a period.
pub(super) struct Newest {
    /// Piston position \[m\].
    pub(super) position: Option<f64>,
    /// Load pressure, and the rod side's share in it \[Pa\].
    pub(super) pressure: Option<(f64, f64)>,
    /// Times of the samples of position and piston-side pressure \[s\].
    pub(super) times: [Option<f64>; 2],
}

/// Position and load pressure along a log, with the last value of each.
pub(super) struct Measurements<'a> {
    positions: Samples<'a>,
    pressures: Option<Samples<'a>>,
    /// Assumed delays of both \[s\].
    late: [f64; 2],
    last_position: Option<f64>,
    last_pressure: Option<(f64, f64)>,
}

impl<'a> Measurements<'a> {
    pub(super) fn new(source: &Source<'a>, late: [f64; 2]) -> Self {
        Self {
            positions: Samples::new(source.position, source.begin + late[0]),
            pressures: source.pressure_a.map(|t| Samples::new(t, source.begin + late[1])),
            late,
            last_position: None,
            last_pressure: None,
        }
    }

    /// Newest unused samples up to a time \[s\].
    pub(super) fn newest(&mut self, source: &Source<'_>, until: f64, is_held: bool) -> Newest {
        let late = self.late;
        let newest = self.positions.newest(until + late[0]);
        let newest_pressure =
            self.pressures.as_mut().and_then(|samples| samples.newest(until + late[1]));
        let position = newest.map(|(_, x)| x);
        let pressure = newest_pressure.and_then(|(at, a)| {
            let b = source.pressure_b?.at(at)?;
            Some((a - source.area_ratio * b, source.area_ratio * b))
        });
        // a shut valve separates the pump side from the cylinder
        let pressure = pressure.filter(|_| !(is_held && source.is_pump_side));
        self.last_position = position.or(self.last_position);
        self.last_pressure = pressure.or(self.last_pressure);
        let times = [newest, newest_pressure].map(|sample| sample.map(|(at, _)| at));
        Newest { position, pressure, times }
    }

    /// Forgets the last values, in a gap.
    pub(super) fn forget(&mut self) {
        (self.last_position, self.last_pressure) = (None, None);
    }

    /// Input of the filter at a motor speed \[rev/s\]; none before the first samples.
    pub(super) fn input(
        &self,
        estimator: &StateEstimator<f64>,
        source: &Source<'_>,
        newest: &Newest,
        motor_speed: f64,
    ) -> Option<EstimatorInput<f64>> {
        let x = self.last_position?;
        let model = &estimator.filter.model;
        // without a load pressure signal that of the crane file's payload is used
        let (p, rod_side_term) =
            match (self.last_pressure, source.pressure_a.and(source.pressure_b)) {
                (Some(last), _) => last,
                (None, None) => (model.at(x, source.payload).holding_pressure, 0.0),
                // the first pressure sample is still to come
                (None, Some(_)) => return None,
            };
        let number = |is: bool| f64::from(u8::from(is));
        Some(EstimatorInput {
            position: x,
            position_is_good: number(newest.position.is_some()),
            load_pressure: p,
            load_pressure_is_good: number(newest.pressure.is_some()),
            rod_side_term,
            motor_speed,
        })
    }
}
