//! Monitor of position against delivered flow: piston travel compared with the pump's delivered
//! volume (analytical redundancy).
//!
//! With the load-holding valves open the oil between pump and piston obeys
//!
//! ```text
//! A Δx + C + λ L + c P − k V = 0
//! C = V_PA ΔS(p_PA) + ∫ V_A(x) dS(p_A),   S(p) = ∫ dp/β      compression
//! L = ∫ (K √(p_PA − p_PB) + K_ext √(p_PA − p_acc)) dt         leakage at its described value
//! P = ∫ |n| (p_PA − p_PB) dt                                      slip that grows with speed
//! V = ∫ n D dt                                                displaced volume
//! ```
//!
//! The gain k, the leakage factor λ, the slip c and the oil lie in ranges of the crane file. Where no values in
//! these ranges make the balance, position and delivered flow disagree; which of them is wrong the
//! balance does not tell. The balance is taken over the whole motion and, because the range of k
//! weighs less the less was delivered, over staggered short windows.
//!
//! C is a function of the pressures only for oil whose air stays as it is. Air that dissolves under pressure
//! and comes out again makes a loop of it: a cycle of pressure leaves a volume that the balance allows for,
//! the larger the more of the oil's transition the pressures of a window span.

use hydroboom_math::Real;
use hydroboom_model::hydraulics::Oil;

/// Windows that overlap, begun one after the other.
const WINDOWS: usize = 6;
/// Transition pressures over their range for which the oil's hysteresis is computed.
const TRANSITIONS: u32 = 5;

/// Closed interval of a parameter, in the parameter's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

/// Monitor of position against delivered flow: its parameters, from a crane file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowMonitor {
    /// Area of the piston on the load-carrying side, A \[m²\].
    pub area: f64,
    /// Pump displacement, D \[m³/rev\].
    pub displacement: f64,
    /// Range of the flow gain k \[1\]: delivered volume per displaced volume.
    pub gain: Range,
    /// Range of the leakage λ \[1\], relative to its value in the crane file.
    pub leakage: Range,
    /// Range of the speed-dependent slip, c \[m³/(rev Pa)\].
    pub slip: Range,
    /// Leakage coefficient between the pump's sides, K \[m³/(s √Pa)\].
    pub internal_leakage: f64,
    /// Case drain coefficient of the pump side, K_ext \[m³/(s √Pa)\].
    pub case_leakage: f64,
    /// Volume of the pump side, V_PA \[m³\].
    pub pump_volume: f64,
    /// Smallest volume of the load-carrying cylinder chamber, V_0A \[m³\].
    pub dead_volume: f64,
    /// Oil at the ends of its range: stiffest, softest.
    pub oils: [Oil<f64>; 2],
    /// Reduction of the oil's transition pressure with all air dissolved \[Pa\].
    pub air_shift: f64,
    /// Length of the stroke \[m\].
    pub stroke: f64,
    /// +1 where the piston side carries the load, −1 where the rod side does.
    pub direction: f64,
    /// Disagreement explained by noise, ripple and delay, as piston travel \[m\].
    pub tolerance: f64,
}

/// What has been summed up since a window began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Balance {
    /// Piston travel times area \[m³\].
    swept: f64,
    /// Compression with either oil \[m³\].
    compressed: [f64; 2],
    /// Leakage at its described value \[m³\].
    leaked: f64,
    /// Revolutions times pressure, P \[rev Pa\].
    turned: f64,
    /// Displaced volume, V \[m³\].
    displaced: f64,
    /// Smallest and largest pressure of the cylinder chamber \[Pa\].
    span: Option<Range>,
    /// Age \[s\].
    age: f64,
}

/// State of the monitor: sums over sliding windows and since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlowMonitorState {
    whole: Balance,
    windows: [Balance; WINDOWS],
    /// The window to be begun anew next, and in how long \[s\].
    next: usize,
    due: f64,
    last: Option<FlowReading>,
}

/// Measurements of a control period for the monitor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowReading {
    /// Piston position \[m\].
    pub stroke: f64,
    /// Motor speed \[rev/s\].
    pub motor_speed: f64,
    /// Gauge pressures \[Pa\]: pump side and cylinder chamber that carry the load, other pump side, accumulator.
    pub pressures: [f64; 4],
}

/// Length of a window \[s\].
pub const WINDOW_TIME: f64 = 5.0;
/// Smallest age of the oldest window \[s\]; windows begin one after the other.
pub const LEAST_WINDOW: f64 = WINDOW_TIME * (WINDOWS as f64 - 1.0) / WINDOWS as f64;

impl FlowMonitor {
    /// Adds a measurement, `elapsed` \[s\] after the last one. Returns the disagreement of position and delivered
    /// volume as piston travel \[m\].
    ///
    /// The disagreement is `|A Δx + C + λ L + c P − k V| / A` at the parameters within their ranges that make it
    /// smallest, less the tolerance and the oil's hysteresis. It is at least zero, and zero at the first measurement
    /// of a state. The balance applies while the load-holding valves are open. A measurement that is not finite
    /// makes the disagreement zero, and the supervisor's [plausibility checks](super::plausibility) find it.
    pub fn advance(&self, state: &mut FlowMonitorState, now: &FlowReading, elapsed: f64) -> f64 {
        let Some(last) = state.last.replace(*now) else { return 0.0 };
        let [pump, load, pump_b, accumulator] = now.pressures;
        let mut change = Balance {
            swept: self.direction * self.area * (now.stroke - last.stroke),
            displaced: self.direction
                * 0.5
                * (now.motor_speed + last.motor_speed)
                * self.displacement
                * elapsed,
            leaked: (self.internal_leakage * signed_root(pump - pump_b)
                + self.case_leakage * signed_root(pump - accumulator))
                * elapsed,
            turned: now.motor_speed.max(-now.motor_speed) * (pump - pump_b) * elapsed,
            compressed: [0.0; 2],
            span: Some(Range { low: load, high: load }),
            age: elapsed,
        };
        let stroke = 0.5 * (now.stroke + last.stroke);
        let travel = if self.direction > 0.0 { stroke } else { self.stroke - stroke };
        let chamber = self.dead_volume + self.area * travel;
        for (volume, oil) in change.compressed.iter_mut().zip(&self.oils) {
            let of =
                |pressure: f64, before: f64| oil.compression(pressure) - oil.compression(before);
            *volume = self.pump_volume * of(pump, last.pressures[0])
                + chamber * of(load, last.pressures[1]);
        }
        state.whole.add(&change);
        state.windows.iter_mut().for_each(|window| window.add(&change));
        state.due -= elapsed;
        if state.due <= 0.0 {
            state.due = WINDOW_TIME / WINDOWS as f64;
            if let Some(window) = state.windows.get_mut(state.next) {
                *window = Balance::default();
            }
            state.next = (state.next + 1) % WINDOWS;
        }
        let worst = state.windows.iter().chain([&state.whole]).map(|b| self.unexplained(b));
        worst.fold(0.0, f64::max)
    }

    /// Smallest drift of the position at rest \[m/s\] that is certainly detected within the time `within` \[s\], above
    /// zero, for any leakage in its range, at a load pressure p \[Pa\].
    ///
    /// It is `tolerance/within + (Δλ + Δk λ_max) (K + K_ext) √p/A`, where Δ is the width of a range.
    pub fn smallest_drift(&self, within: f64, pressure: f64) -> f64 {
        let leaked = (self.internal_leakage + self.case_leakage) * signed_root(pressure);
        // what leaks, and what the pump delivers to make it good
        let leaks = (self.leakage.high - self.leakage.low) * leaked;
        let makes_good = (self.gain.high - self.gain.low) * self.leakage.high * leaked;
        self.tolerance / within + (leaks + makes_good) / self.area
    }

    /// Smallest relative error of the position's gain \[1\] that is certainly detected over a fast travel \[m\], above
    /// zero, for any flow gain and slip in their ranges, at a load pressure p \[Pa\]. Leakage is neglected.
    ///
    /// It is `(Δk + Δc p/D)/k_m + tolerance/travel`, where Δ is the width of a range and k_m the middle of the flow
    /// gain's.
    pub fn smallest_gain_error(&self, travel: f64, pressure: f64) -> f64 {
        let middle = 0.5 * (self.gain.high + self.gain.low);
        let slip = (self.slip.high - self.slip.low) * pressure / self.displacement;
        (self.gain.high - self.gain.low + slip) / middle + self.tolerance / travel
    }

    /// Monitor with narrower ranges of flow gain \[1\], leakage \[1\] and slip \[m³/(rev Pa)\], identified on this
    /// machine. Leakage is relative to its value in the crane file.
    #[must_use]
    pub fn with_baseline(mut self, gain: Range, leakage: Range, slip: Range) -> Self {
        (self.gain, self.leakage, self.slip) = (gain, leakage, slip);
        self
    }

    /// Sums since the start: volume swept by the piston plus compression \[m³\], displaced volume V \[m³\], leaked
    /// volume L by the crane file's leakage \[m³\], revolutions times pressure P \[rev Pa\].
    pub fn sums(state: &FlowMonitorState) -> [f64; 4] {
        let Balance { swept, compressed: [one, other], displaced, leaked, turned, .. } =
            state.whole;
        [swept + 0.5 * (one + other), displaced, leaked, turned]
    }

    /// Distance of zero from all that the ranges allow for A Δx + C + λ L + c P − k V \[m of travel\].
    fn unexplained(&self, b: &Balance) -> f64 {
        let product = |range: &Range, value: f64| {
            let (one, other) = (range.low * value, range.high * value);
            (one.min(other), one.max(other))
        };
        let (leak_low, leak_high) = product(&self.leakage, b.leaked);
        let (slip_low, slip_high) = product(&self.slip, b.turned);
        let (flow_low, flow_high) = product(&self.gain, b.displaced);
        let [one, other] = b.compressed;
        let low = b.swept + one.min(other) + leak_low + slip_low - flow_high;
        let high = b.swept + one.max(other) + leak_high + slip_high - flow_low;
        let off = low.max(-high) / self.area - self.tolerance;
        if off > 0.0 { (off - self.hysteresis(b) / self.area).max(0.0) } else { 0.0 }
    }

    /// Largest volume that air leaves behind which dissolved and came out as the pressures went up and down
    /// \[m³\]: the difference of ΔS without and with dissolved air, once in the time of a window.
    fn hysteresis(&self, b: &Balance) -> f64 {
        let Some(Range { low, high }) = b.span else { return 0.0 };
        let [stiff, soft] = self.oils;
        let undissolved = Range {
            low: stiff.transition_pressure + self.air_shift,
            high: soft.transition_pressure,
        };
        let of = |oil: &Oil<f64>| oil.compression(high) - oil.compression(low);
        let differences = (0..TRANSITIONS).map(|k| {
            let share = f64::from(k) / f64::from(TRANSITIONS - 1);
            let transition_pressure =
                undissolved.low + share * (undissolved.high - undissolved.low);
            let oil = Oil { transition_pressure, ..soft };
            of(&oil) - of(&oil.with_dissolved_air(self.air_shift))
        });
        let volume = self.pump_volume + self.dead_volume + self.area * self.stroke;
        volume * differences.fold(0.0, f64::max) * (b.age / WINDOW_TIME).max(1.0)
    }
}

impl Balance {
    fn add(&mut self, change: &Self) {
        self.swept += change.swept;
        self.displaced += change.displaced;
        self.leaked += change.leaked;
        self.turned += change.turned;
        self.age += change.age;
        self.span = match (self.span, change.span) {
            (Some(a), Some(b)) => Some(Range { low: a.low.min(b.low), high: a.high.max(b.high) }),
            (a, b) => a.or(b),
        };
        for (sum, volume) in self.compressed.iter_mut().zip(change.compressed) {
            *sum += volume;
        }
    }
}

fn signed_root(pressure: f64) -> f64 {
    let root = Real::sqrt(Real::abs(pressure));
    if pressure < 0.0 { -root } else { root }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OIL: Oil<f64> = Oil {
        bulk_modulus_max: 1.6e9,
        bulk_modulus_min: 2e7,
        transition_pressure: 35e5,
        transition_slope: 1.0 / 5e5,
        vapour_pressure: -1e5,
    };
    const SHIFT: f64 = 6e5;
    const ANY: Range = Range { low: 1.0, high: 1.0 };
    const MONITOR: FlowMonitor = FlowMonitor {
        area: 3.3e-3,
        displacement: 1e-5,
        gain: ANY,
        leakage: ANY,
        slip: Range { low: 0.0, high: 0.0 },
        internal_leakage: 0.0,
        case_leakage: 0.0,
        pump_volume: 2e-3,
        dead_volume: 2e-3,
        oils: [
            Oil { transition_pressure: 20e5 - SHIFT, ..OIL },
            Oil { transition_pressure: 45e5, ..OIL },
        ],
        air_shift: SHIFT,
        stroke: 0.5,
        direction: 1.0,
        tolerance: 1e-3,
    };

    /// What remains unexplained of cycles of pressure, 5 to 60 bar within a second, with oil that has dissolved
    /// no air on the way up and all of it on the way down: the pump delivers what the oil takes in.
    fn unexplained(monitor: &FlowMonitor, cycles: u32) -> f64 {
        let volume = monitor.pump_volume + monitor.dead_volume + monitor.area * 0.2;
        let mut state = FlowMonitorState::default();
        let (mut before, mut worst) = (5e5, 0.0_f64);
        for k in 1..=1000 * cycles {
            let phase = f64::from(k % 1000) / 1000.0;
            let pressure = 5e5 + 55e5 * (1.0 - (2.0 * phase - 1.0).abs());
            let oil = if pressure > before { OIL } else { OIL.with_dissolved_air(SHIFT) };
            let flow = volume * (oil.compression(pressure) - oil.compression(before));
            let reading = FlowReading {
                stroke: 0.2,
                // the monitor takes the mean of two periods; this one's flow is in both halves
                motor_speed: flow / (monitor.displacement * 1e-3),
                pressures: [pressure, pressure, 0.0, 0.0],
            };
            worst = worst.max(monitor.advance(&mut state, &reading, 1e-3));
            before = pressure;
        }
        worst
    }

    #[test]
    fn a_pressure_cycle_with_dissolving_air_is_explained_by_the_air_shift() {
        assert_eq!(unexplained(&MONITOR, 1), 0.0);
        let without = FlowMonitor { air_shift: 0.0, ..MONITOR };
        assert!(unexplained(&without, 1) > 1e-3);
    }

    #[test]
    fn at_constant_pressure_air_explains_no_travel() {
        let reading = |stroke: f64| FlowReading {
            stroke,
            motor_speed: 0.0,
            pressures: [60e5, 60e5, 0.0, 0.0],
        };
        let mut state = FlowMonitorState::default();
        MONITOR.advance(&mut state, &reading(0.2), 1e-3);
        let unexplained = MONITOR.advance(&mut state, &reading(0.205), 1e-3);
        assert!((unexplained - (5e-3 - MONITOR.tolerance)).abs() < 1e-12, "{unexplained}");
    }
}
