//! Published benchmark controller on the independent plant and on the virtual crane.

use super::plant::Readings;
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::motion_test::run;

/// Benchmark controller of the model along the motion at a speed \[m/s\], for the independent plant.
pub fn benchmark(model: &Description, speed: f64) -> impl FnMut(&Readings) -> f64 {
    let (controller, motion) = (model.benchmark(), model.motion(speed));
    let cylinder = model.cylinder();
    let mut memory = None;
    move |readings| {
        let reference = motion.reference(readings.time);
        let load_pressure = cylinder.load_pressure(readings.pressure_a, readings.pressure_b);
        let measured = BenchmarkInput { stroke: readings.stroke, load_pressure };
        let memory = memory.get_or_insert_with(|| controller.start(&measured));
        let feedforward = controller.velocity_feedforward(&reference);
        controller.update(memory, &reference, &measured, feedforward)
    }
}

/// RMS true error of the benchmark on the virtual crane along the same motion \[m\].
pub fn rms_error_on_virtual_crane(model: &Description, crane: &Description, speed: f64) -> f64 {
    let motion = model.motion(speed);
    let run = run(model, crane, Strategy::BenchmarkClosedLoop, &motion).unwrap();
    let square = |stroke: f64, time: f64| (stroke - motion.reference(time).position).powi(2);
    let squares = run.samples.iter().map(|s| square(s.truth.outputs.stroke, s.time));
    (squares.sum::<f64>() / run.samples.len() as f64).sqrt()
}
