//! The controller of the tutorial `your-first-controller`.

#[path = "../../examples/first_controller.rs"]
mod example;

use example::{GAINS, line, rms_error};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::simulation::simulate_closed_loop;

/// Without a position loop it is the velocity feedforward of the paper; with one it errs less. The tutorial shows
/// what the example prints.
#[test]
fn the_first_controller_reduces_the_feedforward_error_as_its_tutorial_shows() {
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
    let errors = GAINS.map(|gain| rms_error(gain).unwrap());
    let [open_loop, closed_loop, ..] = errors;
    assert!((open_loop / published - 1.0).abs() < 1e-9, "{open_loop} m, {published} m");
    assert!(closed_loop < 0.5 * open_loop, "{closed_loop} m, {open_loop} m without feedback");
    let printed: String =
        GAINS.iter().zip(errors).map(|(gain, error)| line(*gain, error)).collect();
    let tutorial = include_str!("../../../../docs/tutorial/your-first-controller.md");
    assert!(
        tutorial.contains(&format!("```text\n{printed}```\n")),
        "the example prints\n{printed}"
    );
}
