//! Thresholds for judging a model by a log.

/// Limits for the validation of a model by a log. Each states its unit, and its source or reason; a number without a
/// source is an estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// RMS difference of the position over the piston's travel in the log \[-\]. Half of the difference of
    /// the paper's model (Table 6: 4.4 mm of 400 mm).
    pub position: f64,
    /// RMS difference of a pressure over its largest value in the log \[-\]. Half of the difference of the
    /// paper's model (Table 6: 2.75 bar of 80 bar).
    pub pressure: f64,
    /// Smallest limit of a pressure difference \[Pa\]: error of a typical pressure transducer, 0.25 % of
    /// 100 to 250 bar.
    pub least_pressure: f64,
    /// Smallest limit of a position difference \[m\]: error of a typical position sensor of a cylinder.
    pub least_position: f64,
    /// Relative difference of frequencies \[-\]. The paper's model differs by 1.3 % (2.24 Hz for 2.27 Hz).
    pub frequency: f64,
    /// Relative difference of damping ratios \[-\], at least `least_damping`: an oscillation of a few
    /// periods determines it no better.
    pub damping: f64,
    /// Difference of damping ratios that counts as zero \[-\].
    pub least_damping: f64,
    /// Largest damping ratio of an oscillation with a reliable frequency \[-\]: it has 3.7 periods until it
    /// decays to a tenth. Consider a slow transient of a fifth of the amplitude that settles in 0.3 s, as
    /// after a ramp. The estimator's error is then 1 % at this ratio, 2 % at 0.15 and 7 % at 0.28.
    pub readable_damping: f64,
    /// Share of the RMS difference that may remain after correction if a delay, a clock drift or a sensor
    /// error is to explain most of it \[-\].
    pub most: f64,
    /// Delay that steps and sampling explain \[s\]: a few periods of control and log.
    pub shortest_delay: f64,
    /// Smallest share of a difference's power explained by an offset, a drift or a scale alone for it to be
    /// reported \[-\].
    pub reported_share: f64,
    /// Largest offset of a pressure sensor over the largest pressure of the log \[-\]: sensors of a crane
    /// usually have one range. A larger offset indicates another signal or another load.
    pub sensor_offset: f64,
    /// Largest relative scale error of a sensor \[-\]; a larger one indicates another unit.
    pub sensor_scale: f64,
    /// Share of an error that a redundant sensor must show for the error to be the crane's \[-\].
    pub shared: f64,
    /// Largest share of autocorrelations beyond their bound, 0.05 for white noise, for a difference to
    /// count as sensor noise although it is not white \[-\]. Its RMS must not exceed the noise by more than
    /// the factor `hardly_more`.
    pub nearly_white: f64,
    /// Factor by which the RMS of such a difference may exceed the noise \[-\].
    pub hardly_more: f64,
    /// Smallest reported offset as a share of the displayed unit of its signal \[-\].
    pub least_offset: f64,
    /// Relative frequency differences beyond which log and model may show different modes \[-\].
    pub same_mode: [f64; 2],
    /// Smallest relative decrease of the sum of ½ ln(1 + (found/limit)²) over all judged quantities for a
    /// key to be proposed \[-\].
    pub worthwhile: f64,
    /// Largest factor by which a key is changed, and inverse of the smallest \[-\].
    pub most_change: f64,
    /// Largest plausible pressure of a simulation \[Pa\]; beyond it the piston is at its stop without a
    /// relief valve.
    pub highest_pressure: f64,
}

/// Limits that the verdict, the fault isolation and the remedies use.
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
    reported_share: 0.3,
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
