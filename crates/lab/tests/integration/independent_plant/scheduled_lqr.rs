//! Scheduled LQR on the independent plant.

use super::plant::Readings;
use hydroboom_control::controller::Controller;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::reference::preview::Preview;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::{known_delay, scheduled_lqr_controller};

/// Scheduled LQR of the model along the motion at a speed \[m/s\], for the independent plant.
pub fn scheduled_lqr(model: &Description, speed: f64) -> impl FnMut(&Readings) -> f64 {
    let (motion, period) = (model.motion(speed), model.numbers.control_period);
    let mut controller = scheduled_lqr_controller(model).unwrap();
    let delay_cycles = known_delay(model);
    let mut preview: Option<Preview<f64>> = None;
    let mut number = 0;
    move |r| {
        number += 1;
        let signals = AxisSignals {
            stroke: r.stroke,
            pressure_pump_a: r.pressure_pump_a,
            pressure_a: r.pressure_a,
            pressure_b: r.pressure_b,
            pressure_pump_b: r.pressure_pump_b,
            pressure_accumulator: r.pressure_accumulator,
            motor_speed: r.motor_speed,
        };
        let measurement = Measurement::new(number, r.time, [signals]);
        let ahead = |after: f64| motion.reference(r.time + after);
        match &mut preview {
            Some(preview) => preview.advance(ahead),
            None => controller.start(&measurement, delay_cycles),
        }
        let preview = preview.get_or_insert_with(|| Preview::new(period, ahead));
        controller.update(&measurement, preview, None).axes[0].motor_speed
    }
}
