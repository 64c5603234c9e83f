//! All thresholds by which a model beside a log is judged, and what is said of it.

/// Thresholds, each with its unit and where it comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// RMS difference of the position over the way that the log's piston goes \[-\]. Half of what the paper's model leaves (Table 6: 4.4 mm of 400 mm).
    pub position: f64,
    /// RMS difference of a pressure over the largest that the log has of it \[-\]. Half of what the paper's model leaves (Table 6: 2.75 bar of 80).
    pub pressure: f64,
    /// And never less than this \[Pa\]: error of a usual pressure transducer, 0.25 % of 100 to 250 bar.
    pub least_pressure: f64,
    /// And of a position \[m\]: error of a usual position sensor of a cylinder.
    pub least_position: f64,
    /// Share by which frequencies may differ \[-\]. The paper's model leaves 1.3 % (2.24 Hz for 2.27).
    pub frequency: f64,
    /// Share by which damping ratios may differ \[-\], and never less than `least_damping`: no oscillation of a few periods tells more.
    pub damping: f64,
    /// Difference of damping ratios that is none \[-\].
    pub least_damping: f64,
    /// Damping ratio up to which an oscillation has a frequency that can be read \[-\]: it passes 3.7 periods until a tenth of it is left. Beside a course of a fifth its
    /// size that settles in 0.3 s, as after a ramp, the estimator is off by 1 % there, by 2 % at 0.15 and by 7 % at 0.28.
    pub readable_damping: f64,
    /// Most of a difference: a delay, a clock that drifts, or an error of a sensor explains it where less than this share of its RMS is left without \[-\].
    pub most: f64,
    /// Delays up to this are steps and sampling \[s\]: a few periods of control and log.
    pub shortest_delay: f64,
    /// An offset, a drift or a scale is told where it alone explains this share of a difference's power \[-\].
    pub told: f64,
    /// Largest offset of a sensor, over the largest value of its signal \[-\]: more is another signal, or another load.
    pub sensor_offset: f64,
    /// Largest error of a sensor's scale \[-\]: more is another unit.
    pub sensor_scale: f64,
    /// A sensor beside it shows the same where it has this share of the error \[-\]: then it is the crane's.
    pub shared: f64,
    /// Share of autocorrelations beyond their bound \[-\], of which white noise has 0.05, up to which a difference is the sensor's scatter though it is not white, where its
    /// RMS is hardly more than that, that is by the factor below at most.
    pub nearly_white: f64,
    /// That factor \[-\].
    pub hardly_more: f64,
    /// An offset below this share of the unit that a signal is shown in is not told \[-\].
    pub least_offset: f64,
    /// Frequencies of log and model that differ by a share beyond these need not be of one mode \[-\].
    pub same_mode: [f64; 2],
    /// A key is worth naming where it lowers the sum of ½ ln(1 + (found/limit)²) of all that is judged by this share \[-\].
    pub worthwhile: f64,
    /// No key is tried at more than this factor of its value, or less than its inverse \[-\].
    pub most_change: f64,
    /// A model whose pressures go further is no machine's \[Pa\]: it has a piston at its stop, and no relief valve.
    pub highest_pressure: f64,
}

/// The limits.
pub const LIMITS: Limits = Limits {
    position: 0.006,
    pressure: 0.02,
    least_pressure: 0.3e5,
    least_position: 0.2e-3,
    frequency: 0.02,
    damping: 0.3,
    least_damping: 0.005,
    readable_damping: 0.1,
    most: 0.5,
    shortest_delay: 3e-3,
    told: 0.3,
    sensor_offset: 0.2,
    sensor_scale: 0.3,
    shared: 0.5,
    nearly_white: 0.3,
    hardly_more: 1.2,
    least_offset: 0.1,
    same_mode: [-0.5, 1.0],
    worthwhile: 0.05,
    most_change: 10.0,
    highest_pressure: 1e8,
};
