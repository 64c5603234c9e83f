//! Text on the difference between log and model, and on the keys that would reduce it.

use crate::output::three_digits;
use hydroboom_identify::{
    Aspect, Difference, Differences, Fault, Judgement, LIMITS, Moved, Remedy, Ringing, SignalFault,
    complaints,
};
use hydroboom_measurement::Signal;

/// All differences of a log from the model, and their explanation by faults of signals.
pub struct Context<'a> {
    /// Differences of all signals as measured.
    pub differences: &'a Differences,
    /// Judgements of these differences that are beyond their limits.
    pub complaints: &'a [Judgement],
    /// Faults of signals.
    pub faults: &'a [SignalFault],
    /// Differences that remain after correction of the isolated faults.
    pub remaining: &'a Differences,
}

/// Description of a signal's difference: offset, drift, scale, delay, oscillation; the fault of its sensor; what of it
/// remains after correction of the faults of others.
pub fn text(d: &Difference, context: &Context<'_>) -> String {
    let (unit, size) = d.signal.shown();
    let symbol = d.signal.symbol();
    if let Some(far) = d.unresolved {
        return format!(
            "{symbol}: not judged. The log's samples are {:.0} ms apart, which is too coarse for the model's \
             oscillation at {:.2} Hz.",
            far.interval * 1e3,
            far.frequency
        );
    }
    let own: Vec<&Judgement> = context.complaints.iter().filter(|j| j.signal == d.signal).collect();
    let is_scatter = d.rms < LIMITS.hardly_more * d.noise && d.coloured < LIMITS.nearly_white;
    // white noise about an offset is not noise alone
    let is_noise =
        (d.is_white || is_scatter) && d.bias.abs() < d.noise.max(LIMITS.least_offset * size);
    if own.is_empty() && is_noise {
        return format!("{symbol}: only sensor noise remains.");
    }
    let mut parts =
        [static_errors(d), timing_errors(d, context), oscillation_errors(d, &own)].concat();
    if parts.is_empty() {
        parts.push(format!("differs by {} {unit} RMS", three_digits(d.rms / size)));
    }
    let mut sentences = format!("{symbol}: {}.", parts.join("; "));
    if own.is_empty() {
        sentences += " That is within its limit.";
    }
    if let Some(fault) = context.faults.iter().find(|fault| fault.signal == d.signal) {
        return sentences + &sensor_fault(fault);
    }
    // a delay that is reported already is not repeated
    let is_reported = |fault: &SignalFault| d.is_late() && matches!(fault.fault, Fault::Delay(_));
    let causes = context.faults.iter().filter(|fault| fault.is_isolable() && !is_reported(fault));
    let causes: Vec<&SignalFault> =
        causes.filter(|fault| fault.explains.contains(&d.signal)).collect();
    if let (Some(left), false) =
        (context.remaining.iter().find(|l| l.signal == d.signal), causes.is_empty())
    {
        let causes: Vec<String> = causes.iter().map(|fault| fault_name(fault)).collect();
        let rms = three_digits(left.rms / size);
        sentences += &format!(
            " Most of it is due to the {}: {rms} {unit} RMS would remain.",
            causes.join(" and the ")
        );
    }
    sentences
}

/// Name of a fault: "offset of p_B".
fn fault_name(fault: &SignalFault) -> String {
    let what = match fault.fault {
        Fault::Offset(_) => "offset",
        Fault::Scale(_) => "scale",
        Fault::Delay(_) => "delay",
    };
    format!("{what} of {}", fault.signal.symbol())
}

/// Symbols separated by commas and a final "and".
fn listed(signals: &[Signal]) -> String {
    let symbols: Vec<&str> = signals.iter().map(|signal| signal.symbol()).collect();
    match symbols.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        _ => symbols.concat(),
    }
}

/// Description of an input delay, one cause for all signals that follow the input; none for another fault.
pub fn input_delay(fault: &SignalFault) -> Option<String> {
    let Fault::Delay(late) = fault.fault else { return None };
    let way = if late > 0.0 { "late" } else { "early" };
    let why = match (fault.signal, late > 0.0) {
        (Signal::HoldingValve, true) => "a column that was recorded late",
        (Signal::HoldingValve, false) => "a valve that follows its command later",
        (Signal::ValveCommand, true) => {
            "a column that was recorded late, or a valve that is faster than the model's (valve.bandwidth_hz)"
        }
        (Signal::ValveCommand, false) => {
            "a valve that responds later than the model's (dead time, valve.bandwidth_hz), or a common delay of \
             these signals"
        }
        (Signal::MotorCommand, _) => {
            "the motor's speed was not recorded, and the drive follows its command later"
        }
        (_, true) => "a column that was recorded late (filter, fieldbus)",
        (_, false) => "a command in place of the speed, or a common delay of these signals",
    };
    Some(format!(
        "{}: {:.1} ms {way} relative to {}. This explains most of their differences: {why}. No sensor is assumed \
         to be {} ([log.{}] delay_ms {:+.1}).",
        fault.signal.symbol(),
        late.abs() * 1e3,
        listed(&fault.explains),
        if late > 0.0 { "early" } else { "late" },
        fault.signal.key(),
        late * 1e3
    ))
}

/// Description of a constant fault of a sensor, with its correction in the mapping.
fn sensor_fault(error: &SignalFault) -> String {
    let (unit, size) = error.signal.shown();
    let (what, mapping) = match error.fault {
        Fault::Offset(off) => (
            format!("A constant offset of its sensor by {:+.3} {unit}", off / size),
            format!(
                "add {:+.3} {unit} to its offset, or {:+.3} {unit} where its sign is -1",
                -off / size,
                off / size
            ),
        ),
        Fault::Scale(factor) => (
            format!("A scale of its sensor that is wrong by {:+.2} %", 100.0 * (factor - 1.0)),
            format!("scale and offset times {:.4}", 1.0 / factor),
        ),
        Fault::Delay(late) => {
            (format!("A delay of {:+.1} ms", late * 1e3), format!("delay_ms {:+.1}", late * 1e3))
        }
    };
    let others: Vec<Signal> =
        error.explains.iter().copied().filter(|signal| *signal != error.signal).collect();
    let others = match others.as_slice() {
        [] => String::new(),
        others => format!(", and most of the differences of {}", listed(others)),
    };
    let against = match (error.against, error.signal) {
        (Some(other), Signal::PressureAccumulator) => format!(
            "; {}, which it feeds, does not show it, so the crane is not the cause",
            other.symbol()
        ),
        (Some(other), _) => {
            format!("; {} does not show it, so the crane is not the cause", other.symbol())
        }
        (None, Signal::PressureAccumulator) => {
            "; without p_B and p_PB another gas charge of the accumulator has the same effect"
                .into()
        }
        (None, _) => ", if the crane is not the cause".into(),
    };
    let left = error.left.map_or(String::new(), |left| {
        format!(": {} {unit} RMS would remain", three_digits(left / size))
    });
    format!(
        " {what} would explain it{others}{left}{against}. Correction in the mapping: [log.{}] {mapping}.",
        error.signal.key()
    )
}

/// Smallest relative change of a quantity by a key that is reported.
const MOVED: f64 = 0.01;

/// Advice for all signals together: changes of keys that reduce the differences. None without a judgement beyond its
/// limit, and if no key could be the cause (`asks_for_keys` is false).
pub fn advice(
    complaints: &[Judgement],
    remedies: &[Remedy],
    asks_for_keys: bool,
) -> Option<String> {
    if complaints.is_empty() || !asks_for_keys {
        return None;
    }
    if remedies.is_empty() {
        return Some(
            "No tested key reduces the sum of the differences of all signals by 5 %.".into(),
        );
    }
    let list: Vec<String> = remedies
        .iter()
        .map(|r| {
            let end = if r.at_limit { ", the limit of the tested range" } else { "" };
            let is_moved = |m: &&Moved| (m.found.1 - m.found.0).abs() >= MOVED * m.found.0.abs();
            let moved: Vec<String> = r.moved.iter().filter(is_moved).map(moved).collect();
            let change = 100.0 * r.change;
            let sign = if change > 0.0 { "+" } else { "" };
            format!("{} {sign}{} %{end} ({})", r.path, three_digits(change), moved.join(", "))
        })
        .collect();
    Some(format!(
        "Changes that reduce the sum of all differences beyond their limits, each key on its own: {}.",
        list.join("; ")
    ))
}

/// Description of a key's effect on one judged quantity.
fn moved(of: &Moved) -> String {
    let ((before, after), symbol) = (of.found, of.signal.symbol());
    match of.aspect {
        Aspect::Frequency => {
            format!("{symbol} frequency {after:.2} Hz instead of {before:.2}, log {:.2}", of.wanted)
        }
        Aspect::Damping => {
            format!(
                "{symbol} damping ratio {after:.3} instead of {before:.3}, log {:.3}",
                of.wanted
            )
        }
        Aspect::Position | Aspect::Pressures => {
            let (unit, size) = of.signal.shown();
            format!(
                "{symbol} {} instead of {} {unit} RMS",
                three_digits(after / size),
                three_digits(before / size)
            )
        }
    }
}

/// Whether a judgement beyond its limit could be due to keys and not to a delayed sensor or a clock.
pub fn asks_for_keys(remaining: &Differences) -> bool {
    let is_other = |j: &Judgement| {
        let is_size = matches!(j.aspect, Aspect::Position | Aspect::Pressures);
        let of = remaining.iter().find(|d| d.signal == j.signal);
        is_size && of.is_some_and(|d| d.is_late() || d.is_of_clock())
    };
    complaints(remaining).iter().any(|j| !is_other(j))
}

/// Warning of a simulation beyond the model's range of validity; `highest` is its largest pressure \[Pa\].
pub fn remark_on_validity(highest: f64) -> Option<String> {
    (highest > LIMITS.highest_pressure).then(|| {
        format!(
            "the model reaches {:.0} bar: its piston is driven against an end stop, and no relief valve opens",
            highest * 1e-5
        )
    })
}

/// Description of offset, drift and scale.
fn static_errors(d: &Difference) -> Vec<String> {
    let (unit, size) = d.signal.shown();
    let Some(explained) = d.parts else { return Vec::new() };
    let signed = |value: f64| {
        let sign = if value > 0.0 { "+" } else { "" };
        format!("{sign}{}", three_digits(value))
    };
    let mut parts = Vec::new();
    let mut report = |share: f64, what: String| {
        if share > LIMITS.reported_share {
            parts.push(format!("{what}, {:.0} % of the difference's power", share * 100.0));
        }
    };
    let offset = signed(explained.offset.value / size);
    report(explained.offset.share, format!("has an offset of {offset} {unit} from the model"));
    let drift = signed(explained.drift.value / size);
    report(explained.drift.share, format!("drifts from the model by {drift} {unit}/s"));
    let way = if explained.scale.value > 0.0 { "more" } else { "less" };
    let scale = three_digits(explained.scale.value.abs() * 100.0);
    let scale = match explained.scale.value < -1.0 {
        true => "moves in the opposite direction to the model".into(),
        false => format!("moves {scale} % {way} than the model"),
    };
    report(explained.scale.share, scale);
    parts
}

/// Description of a delay or a clock drift.
fn timing_errors(d: &Difference, context: &Context<'_>) -> Vec<String> {
    if let (true, Some([first, second]), Some(drift)) = (d.is_of_clock(), d.delay_halves, d.drift) {
        return vec![format!(
            "is {:.1} ms late in the first half and {:.1} ms in the second, which explains most of the difference: clock drift \
             (drift_ppm = {:.0} in the mapping)",
            first * 1e3,
            second * 1e3,
            drift * 1e6
        )];
    }
    let Some(delay) = d.delay.filter(|_| d.is_late()) else { return Vec::new() };
    let way = if delay > 0.0 { "late" } else { "early" };
    let is_of_input = |fault: &&SignalFault| {
        matches!(fault.fault, Fault::Delay(_)) && fault.explains.contains(&d.signal)
    };
    let is_alone = |other: &Difference| other.signal == d.signal || other.delay.is_none();
    let why = if let Some(input) = context.faults.iter().find(is_of_input) {
        format!(", due to the delay of {}", input.signal.symbol())
    } else if context.differences.iter().all(is_alone) {
        ": a delay of sensor or fieldbus (delay_ms in the mapping), or of the machine's input; no other signal \
         shows which".into()
    } else if delay > 0.0 {
        ": a delay of sensor or fieldbus (delay_ms in the mapping)".into()
    } else {
        ": a sensor cannot be early, so the model lags, or other signals are late".into()
    };
    vec![format!(
        "is {:.1} ms {way}, which explains most of the difference{why}",
        delay.abs() * 1e3
    )]
}

/// Description of the oscillations of log and model beyond their limits.
fn oscillation_errors(d: &Difference, own: &[&Judgement]) -> Vec<String> {
    // an oscillation without an identified damping has no reliable frequency
    let reliable = |r: Option<Ringing>| r.filter(|r| r.damping.is_some());
    let (Some(log), Some(model)) = (reliable(d.ringing), reliable(d.model_ringing)) else {
        return Vec::new();
    };
    let [low, high] = LIMITS.same_mode;
    let is_same_mode = (low..high).contains(&(log.frequency / model.frequency - 1.0));
    let (of_log, of_model) = (log.frequency, model.frequency);
    let of = |j: &&Judgement| match (j.aspect, log.damping, model.damping) {
        // with such a difference it may not be the same mode
        (Aspect::Frequency, ..) if !is_same_mode => Some(format!(
            "oscillates at {of_log:.2} Hz, the model at {of_model:.2} Hz: a load, a lever or a stiffness that is \
             far from the crane file's, or something else that vibrates"
        )),
        (Aspect::Frequency, ..) => {
            let how = if j.found < 0.0 { "stiffer, or lighter," } else { "softer, or heavier," };
            Some(format!(
                "oscillates at {of_log:.2} Hz, the model at {of_model:.2} Hz: the crane is {how} than the model"
            ))
        }
        (Aspect::Damping, Some(a), Some(b))
            if is_same_mode
                || !(log.has_reliable_frequency() && model.has_reliable_frequency()) =>
        {
            let how = if j.found < 0.0 { "more" } else { "less" };
            Some(format!("is damped {how} ({a:.3}) than the model ({b:.3})"))
        }
        _ => None,
    };
    own.iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_identify::{Explained, Part};

    fn part(value: f64, share: f64) -> Part {
        Part { value, share }
    }

    /// Load pressure with a difference of 5 bar, which is beyond its limit.
    fn difference() -> Difference {
        Difference {
            signal: Signal::PressureA,
            count: 1000,
            rms: 5e5,
            peak: 8e5,
            bias: 0.0,
            correlation: None,
            fit: None,
            delay: None,
            rms_without_delay: None,
            delay_halves: None,
            drift: None,
            rms_without_drift: None,
            ringing: None,
            model_ringing: None,
            coloured: 1.0,
            is_white: false,
            parts: None,
            span: 10e5,
            largest: 80e5,
            noise: 1e3,
            unresolved: None,
        }
    }

    fn rings(frequency: f64) -> Option<Ringing> {
        Some(Ringing { frequency, damping: Some(0.05), amplitude: 1e5 })
    }

    fn read(d: &Difference, faults: &[SignalFault]) -> String {
        let differences = vec![d.clone()];
        let complaints = complaints(&differences);
        let (differences, complaints) = (&differences, &complaints);
        text(d, &Context { differences, complaints, faults, remaining: differences })
    }

    #[test]
    fn a_scale_error_is_reported_and_so_is_a_wrong_sign() {
        let of = |scale: f64| {
            let (scale, none) = (part(scale, 0.9), part(0.0, 0.0));
            let parts = Explained { offset: none, drift: none, scale, delay: none };
            read(&Difference { parts: Some(parts), ..difference() }, &[])
        };
        assert!(of(-0.498).contains("moves 49.8 % less than the model"), "{}", of(-0.498));
        assert!(of(0.05).contains("moves 5.00 % more than the model"), "{}", of(0.05));
        assert!(of(-1.4).contains("moves in the opposite direction"), "{}", of(-1.4));
    }

    /// A white residual about an offset: the offset is not sensor noise.
    #[test]
    fn an_offset_is_not_taken_for_noise() {
        let white =
            Difference { coloured: 0.02, is_white: true, noise: 1e3, rms: 4e3, ..difference() };
        assert!(read(&white, &[]).contains("only sensor noise"), "{}", read(&white, &[]));
        let off = Difference { bias: 5e5, rms: 5e5, ..white };
        assert!(!read(&off, &[]).contains("only sensor noise"), "{}", read(&off, &[]));
        assert!(read(&off, &[]).contains("5.00 bar"), "{}", read(&off, &[]));
    }

    /// A payload at 9 m oscillates at 0.82 Hz instead of 2.25 Hz, which is no other source of vibration.
    #[test]
    fn a_large_frequency_difference_is_attributed_to_the_load() {
        let far = Difference { ringing: rings(0.82), model_ringing: rings(2.25), ..difference() };
        let text = read(&far, &[]);
        assert!(text.contains("a load, a lever or a stiffness that is far from"), "{text}");
        assert!(!text.contains("heavier"), "{text}");
        let near = Difference { ringing: rings(2.1), ..far };
        assert!(read(&near, &[]).contains("softer, or heavier, than"), "{}", read(&near, &[]));
    }

    /// Damping so strong that there are less than two periods: the frequencies are not compared, the
    /// dampings are.
    #[test]
    fn an_unreliable_frequency_is_not_compared() {
        let brief = Some(Ringing { frequency: 2.36, damping: Some(0.28), amplitude: 1e5 });
        let text =
            read(&Difference { ringing: brief, model_ringing: rings(2.21), ..difference() }, &[]);
        assert!(!text.contains("Hz") && text.contains("is damped more (0.280)"), "{text}");
    }

    #[test]
    fn a_sensor_fault_is_reported_with_its_mapping_correction() {
        let error = |fault, against| SignalFault {
            signal: Signal::PressureA,
            fault,
            left: Some(0.1e5),
            against,
            explains: Vec::new(),
        };
        let offset = error(Fault::Offset(5e5), Some(Signal::PressurePumpA));
        let text = read(&difference(), &[offset]);
        assert!(text.contains("A constant offset of its sensor by +5.000 bar would explain it: 0.100 bar RMS would remain; p_PA does not show it, so the crane is not the cause. Correction in the mapping: [log.pressure_a] add -5.000 bar to its offset, or +5.000 bar where its sign is -1."), "{text}");
        let text = read(&difference(), &[error(Fault::Scale(1.25), None)]);
        assert!(
            text.contains("wrong by +25.00 %") && text.contains("scale and offset times 0.8000"),
            "{text}"
        );
        assert!(text.contains(", if the crane is not the cause."), "{text}");
        // without remaining differences no key is searched
        assert!(asks_for_keys(&vec![difference()]));
        assert!(advice(&complaints(&vec![difference()]), &[], false).is_none());
    }

    #[test]
    fn advice_lists_the_effect_of_each_key_on_each_signal() {
        let d = difference();
        let moved = |aspect, signal, found| Moved { aspect, signal, found, wanted: 2.0 };
        let remedy = Remedy {
            path: "payload.mass_kg".into(),
            change: -0.0003,
            at_limit: true,
            misfit: (3.0, 1.2),
            moved: vec![
                moved(Aspect::Pressures, Signal::PressureA, (5e5, 1e5)),
                moved(Aspect::Frequency, Signal::PressureA, (2.25, 2.02)),
            ],
        };
        let all = complaints(&vec![d.clone()]);
        let text = advice(&all, &[remedy], true).unwrap();
        assert!(text.contains("payload.mass_kg -0.0300 %, the limit of the tested range (p_A 1.00 instead of 5.00 bar RMS, p_A frequency 2.02 Hz instead of 2.25, log 2.00)"), "{text}");
        assert!(advice(&all, &[], true).unwrap().starts_with("No tested key"));
        let within = Difference { rms: 1e5, ..difference() };
        assert!(read(&within, &[]).ends_with("That is within its limit."));
        let late = Difference { delay: Some(0.02), rms_without_delay: Some(0.4e5), ..difference() };
        let text = read(&late, &[]);
        assert!(text.contains("is 20.0 ms late") && !text.contains("key"), "{text}");
        assert!(text.contains("no other signal shows which"), "{text}");
        assert!(!asks_for_keys(&vec![late]));
        assert!(remark_on_validity(3.5e8).unwrap().contains("3500 bar"));
        assert!(remark_on_validity(3e7).is_none());
    }
}
