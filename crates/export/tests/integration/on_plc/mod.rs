//! Framed controllers as on a PLC: interpreted Structured Text on the virtual crane.

use super::evaluator::{Instance, Library};
use hydroboom_control::supervision::frame::{FrameInput, FrameOutput};
use hydroboom_description::Description;
use hydroboom_export::closed_loop::{
    Bad, Case, Disturbed, Moment, Row, RustBenchmark, Target, TargetError, bounds, cases, run,
};
use hydroboom_export::structured_text::{Kind, Unit, units};

/// A framed controller in Structured Text.
struct OnPlc {
    block: Instance,
    /// Calls in a control period.
    calls: u32,
}

impl Target for OnPlc {
    fn name(&self) -> &'static str {
        match self.calls {
            1 => "Structured Text, benchmark",
            _ => "Structured Text, simulation feedforward",
        }
    }

    fn period(
        &mut self,
        input: &FrameInput<f64>,
        gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError> {
        assert_eq!(gain, 1.0, "gains are not changed here");
        let truths = [
            ("bEnable", input.enable > 0.5),
            ("bHold", input.hold > 0.5),
            ("bStart", input.start > 0.5),
            ("bResetFault", input.reset_fault > 0.5),
        ];
        let numbers = [
            ("uValveRead", input.valve_state),
            ("xRef", input.reference_position),
            ("vRef", input.reference_velocity),
            ("xCyl", input.stroke),
            ("pPA", input.pressure_pump_a),
            ("pA", input.pressure_a),
            ("pB", input.pressure_b),
            ("pPB", input.pressure_pump_b),
            ("nRead", input.motor_speed_read),
        ];
        for _ in 0..self.calls {
            self.block.call_with(&numbers, &truths);
        }
        Ok(FrameOutput {
            motor_speed: self.block.value("nRef"),
            holding_valve: f64::from(u8::from(self.block.holds("bHoldingValve"))),
            status: self.block.count("nStatus") as f64,
            reference_offset: self.block.value("referenceOffset"),
            oscillation_amplitude: self.block.value("oscillationAmplitude"),
            oscillation_frequency: self.block.value("oscillationFrequency"),
        })
    }
}

/// Trials of the benchmark's block: engaged, held for a second, with an error of each kind in each of the first
/// `inputs` inputs from the piston position on. The block with simulation is engaged and held.
pub fn rows(model: &Description, machine: &Description, inputs: usize) -> Vec<Row> {
    let all = cases(model);
    let plain = all.iter().find(|c| c.moves && c.disturbed.is_none() && c.gain.is_none()).unwrap();
    let undisturbed = run(model, machine, plain, &mut RustBenchmark::new(model).unwrap()).unwrap();
    let texts: Vec<String> =
        units(model).unwrap().iter().filter(|u| u.kind != Kind::Globals).map(Unit::text).collect();
    let library = Library::parse(texts.iter().map(String::as_str));
    let engaged = Case { moves: false, ..plain.clone() };
    let mut tried: Vec<(Case, &str, u32)> = vec![
        (engaged.clone(), "FB_BenchmarkController", 1),
        (engaged.clone(), "FB_SimulationFeedforward", 20),
    ];
    let first = FrameInput::NAMES.iter().position(|name| *name == "stroke").unwrap();
    for input in first..(first + inputs).min(FrameInput::NAMES.len()) {
        for bad in Bad::ALL {
            let disturbed = Some(Disturbed { input, bad, periods: 500, moment: Moment::Rest });
            tried.push((Case { disturbed, ..engaged.clone() }, "FB_BenchmarkController", 1));
        }
    }
    let row = |(case, name, calls): (Case, &str, u32)| {
        let mut target = OnPlc { block: library.instance(name), calls };
        let outcome = run(model, machine, &case, &mut target).unwrap();
        let within = bounds(model, &case, &undisturbed, &outcome).unwrap();
        Row::new(target.name(), &case, outcome, within, &undisturbed)
    };
    tried.into_iter().map(row).collect()
}
