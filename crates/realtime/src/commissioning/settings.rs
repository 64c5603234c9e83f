//! Bounds, speeds and times of commissioning.
//!
//! The crane file gives the rest: ranges, noise limits, the slow speed of the motor, the release, and the stopping
//! time ([`Limits`](hydroboom_control::supervision::limits::Limits)).

/// Bounds, speeds and times. The defaults are choices of this project and small against the stroke of a crane's
/// cylinder (500 mm on the paper's crane); where a number follows from something else, its line says so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Duration of listening \[s\], 1 to 60: many periods of a load mode of 1 to 5 Hz.
    pub listening: f64,
    /// Time that a machine has to become ready, or to enable its drives \[s\], 1 to 60.
    pub ready: f64,
    /// Time that the operator has to open the stop circuit \[s\], 10 to 600.
    pub opening: f64,
    /// Time that the operator has to close it, and to reset the machine \[s\], 10 to 3600.
    pub resetting: f64,
    /// Time that the operator has to start a motion \[s\], 2 to 3600.
    pub starting: f64,
    /// Largest movement of the piston while the valve is shut \[m\], 0.2 to 2 mm. The supervisor's own limit of a held
    /// load applies where it is smaller.
    pub held_movement: f64,
    /// Time in which the motor has to reach its slow speed \[s\], 0.2 to 5.
    pub turning: f64,
    /// Largest deviation of the measured motor speed from the commanded one, relative to it \[1\], 0.05 to 0.5.
    pub speed_tolerance: f64,
    /// Time after watchdog and braking time within which the motor has to be at rest \[s\], 0.02 to 0.2.
    pub watchdog_margin: f64,
    /// Rise of the pump side's pressure that shows the polarity \[Pa\], 2 to 20 bar; six standard deviations of the
    /// noise at least.
    pub pressure_rise: f64,
    /// Least excess of the load's pressure over the pump side's in the slow turn, so that no oil passes the valve
    /// \[Pa\], 5 to 50 bar.
    pub pressure_margin: f64,
    /// Time for the pump side to drain where that difference is missing \[s\], 0 to 120.
    pub draining: f64,
    /// Duration of the slow turn \[s\], 1 to 60.
    pub polarity: f64,
    /// Movement of the load at which the release stops \[m\], 1 to 10 mm.
    pub release_movement: f64,
    /// Distance of the travel \[m\], 2 to 20 mm.
    pub travel: f64,
    /// Its largest speed \[m/s\], 2 to 20 mm/s.
    pub travel_speed: f64,
    /// Deviation of the piston from the set point, in either direction, that ends the travel \[m\], 1 to 5 mm.
    pub travel_deviation: f64,
    /// Largest relative deviation of the travel by position from that by the pump's volume \[1\], 0.02 to 0.2; the
    /// half width of the range of the pump's gain in the crane file where that is more.
    pub scale_tolerance: f64,
    /// Largest delay from sampling to actuation \[cycles\], 1 to 50.
    pub largest_delay: f64,
    /// Time for which the piston is monitored after the stop \[s\], 0.5 to 5.
    pub watching: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            listening: 3.0,
            ready: 10.0,
            opening: 120.0,
            resetting: 600.0,
            starting: 600.0,
            held_movement: 1e-3,
            turning: 1.0,
            speed_tolerance: 0.2,
            watchdog_margin: 0.05,
            pressure_rise: 5e5,
            pressure_margin: 10e5,
            draining: 30.0,
            polarity: 20.0,
            release_movement: 3e-3,
            travel: 5e-3,
            travel_speed: 10e-3,
            travel_deviation: 2e-3,
            scale_tolerance: 0.06,
            largest_delay: 10.0,
            watching: 1.0,
        }
    }
}
