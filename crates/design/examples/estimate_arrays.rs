//! The state estimator along arrays of readings, 1 ms apart: `cargo run -p hydroboom-design --example estimate_arrays`.
//!
//! Here a crane rests at half its stroke while its pump holds 68 bar; readings of a log go in the same way.

use hydroboom_control::estimation::extended_kalman_filter::EstimatorInput;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::{designed, known_delay};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let readings = 3000;
    let position = vec![0.25; readings]; // m
    let pressures = vec![[68e5, 3e5]; readings]; // Pa, on the piston and on the rod side
    let motor_speed = vec![0.9; readings]; // rev/s

    let crane = Description::uia_single_boom()?;
    let (estimator, _) = designed(&crane, known_delay(&crane) as usize)?;
    let ratio = crane.cylinder().area_ratio();
    let input = |k: usize| EstimatorInput {
        position: position[k],
        position_is_good: 1.0,
        load_pressure: pressures[k][0] - ratio * pressures[k][1],
        load_pressure_is_good: 1.0,
        rod_side_term: ratio * pressures[k][1],
        motor_speed: motor_speed[k],
    };
    let mut state = estimator.start(&input(0));
    (1..readings).for_each(|k| estimator.update(&mut state, &input(k), motor_speed[k]));

    let (estimate, deviation) = (state.filter.estimate, estimator.filter.deviation(&state.filter));
    println!("payload {:.0} kg ± {:.0}", estimate.payload, 2.0 * deviation.payload);
    println!(
        "unknown flow {:.2} rev/s ± {:.2}",
        estimate.unknown_flow,
        2.0 * deviation.unknown_flow
    );
    println!("mean NIS {:.2}, 1 where the model explains the readings", state.filter.mean_nis);
    Ok(())
}
