//! The controller of the tutorial `your-first-controller`.

#[path = "../../examples/first_controller.rs"]
mod example;

use example::rms_error;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::simulation::simulate_closed_loop;

/// Without a position loop it is the velocity feedforward of the paper; with one it errs less.
#[test]
fn the_first_controller_adds_feedback_that_reduces_the_feedforward_error() {
    let (model, crane) =
        (Description::uia_single_boom().unwrap(), Description::uia_virtual().unwrap());
    let course = model.motion(model.numbers.fast);
    let (mut sum, mut count) = (0.0, 0.0);
    let strategy = Strategy::VelocityFeedforward;
    simulate_closed_loop(&model, &crane, strategy, &course, |sample| {
        sum += sample.true_error().powi(2);
        count += 1.0;
        Ok(())
    })
    .unwrap();
    let published = f64::sqrt(sum / count);
    let open_loop = rms_error(0.0).unwrap();
    assert!((open_loop / published - 1.0).abs() < 1e-9, "{open_loop} m, {published} m");
    let closed_loop = rms_error(0.5).unwrap();
    assert!(closed_loop < 0.5 * open_loop, "{closed_loop} m, {open_loop} m without feedback");
}
