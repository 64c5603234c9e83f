//! Safety margins of a crane for a cycle without feedback. Commands that exceed them are not applied to a
//! machine.

use super::record::Record;
use crate::closed_loop::scenario::Course;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::Description;

/// Velocity below which a reference is at rest \[m/s\].
const REST: f64 = 1e-9;

/// Name of a pressure, and its signal.
type Pressure = (&'static str, fn(&AxisSignals<f64>) -> f64);

/// Pressures limited by the supervision.
const PRESSURES: [Pressure; 4] = [
    ("p_PA", |r| r.pressure_pump_a),
    ("p_A", |r| r.pressure_a),
    ("p_B", |r| r.pressure_b),
    ("p_PB", |r| r.pressure_pump_b),
];

/// Margins of a crane that a cycle exceeds, a sentence each with the largest value and its time. Checked
/// are pressures, distance from the end stops in motion, tracking error without feedback, and motor speed.
pub(crate) fn exceeded(crane: &Description, record: &Record, course: &dyn Course) -> Vec<String> {
    let n = &crane.numbers;
    let time = |k: usize| k as f64 * record.period;
    let readings = || record.readings.iter().enumerate();
    let most = |of: &dyn Fn(usize, &AxisSignals<f64>) -> f64| {
        readings().map(|(k, r)| (time(k), of(k, r))).max_by(|a, b| a.1.total_cmp(&b.1))
    };
    // a value that is not a number is within no limit
    let exceeds = |value: f64, limit: f64| value.is_nan() || value > limit;
    let mut said = Vec::new();
    let limit = n.supervision_pressure;
    for (name, of) in PRESSURES {
        let Some((at, p)) = most(&|_, r| of(r)).filter(|(_, p)| exceeds(*p, limit)) else {
            continue;
        };
        said.push(format!(
            "{name} is {:.1} bar at {at:.3} s, and supervision.pressure_bar allows {:.1}",
            p * 1e-5,
            limit * 1e-5
        ));
    }
    let margin = n.supervision_end_margin;
    let too_near = |k: usize, r: &AxisSignals<f64>| match course.reference(time(k)).velocity {
        v if v > REST => r.stroke - (n.stroke - margin),
        v if v < -REST => margin - r.stroke,
        _ => f64::NEG_INFINITY,
    };
    if let Some((at, near)) = most(&too_near).filter(|(_, near)| exceeds(*near, 0.0)) {
        said.push(format!(
            "the moving piston is {:.1} mm from its end stop at {at:.3} s, and supervision.end_margin_mm is {:.1}",
            (margin - near) * 1e3,
            margin * 1e3
        ));
    }
    let limit = n.supervision_tracking_open_loop;
    let error =
        |k: usize, r: &AxisSignals<f64>| (r.stroke - course.reference(time(k)).position).abs();
    if let Some((at, error)) = most(&error).filter(|(_, error)| exceeds(*error, limit)) {
        said.push(format!(
            "the tracking error is {:.1} mm at {at:.3} s, and supervision.tracking_open_loop_mm allows {:.1}",
            error * 1e3,
            limit * 1e3
        ));
    }
    let fastest = record.commands.iter().enumerate().map(|(k, c)| (time(k), c.motor_speed.abs()));
    let fastest = fastest.max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((at, speed)) = fastest.filter(|(_, v)| exceeds(*v, n.motor_speed * (1.0 + 1e-9))) {
        said.push(format!(
            "the commanded motor speed is {:.0} rpm at {at:.3} s, and motor.max_speed_rpm is {:.0}",
            speed * 60.0,
            n.motor_speed * 60.0
        ));
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::command::AxisCommand;

    /// Change of a period, given its number.
    type Change<'a> = &'a dyn Fn(usize, &mut AxisSignals<f64>, &mut AxisCommand<f64>);

    #[test]
    fn each_exceeded_margin_is_reported_with_time_and_amount() {
        let crane = Description::uia_single_boom().unwrap();
        let course = crane.motion(crane.numbers.fast);
        let period = crane.numbers.control_period;
        let cycle = |change: Change<'_>| {
            let mut record = Record::new(period);
            for k in 0..4000 {
                let stroke = course.reference(k as f64 * period).position;
                let mut reading =
                    AxisSignals { stroke, pressure_a: 70e5, ..AxisSignals::default() };
                let mut command = AxisCommand { motor_speed: 10.0, holding_valve: 1.0 };
                change(k, &mut reading, &mut command);
                record.push(command, reading);
            }
            exceeded(&crane, &record, &course)
        };
        assert!(cycle(&|_, _, _| {}).is_empty());
        let at = |k: usize| k == 2500;
        let pressure = cycle(&|k, r, _| {
            if at(k) {
                r.pressure_pump_b = 212.3e5
            }
        });
        assert!(
            pressure.len() == 1 && pressure[0].contains("p_PB is 212.3 bar at 2.500 s"),
            "{pressure:?}"
        );
        let stop = cycle(&|k, r, _| {
            if at(k) {
                r.stroke = 0.4995
            }
        });
        assert!(stop.iter().any(|s| s.contains("end stop at 2.500 s")), "{stop:?}");
        let error = cycle(&|k, r, _| {
            if at(k) {
                r.stroke -= 0.13
            }
        });
        assert!(error.iter().any(|s| s.contains("130.0 mm at 2.500 s")), "{error:?}");
        let speed = cycle(&|k, _, c| {
            if at(k) {
                c.motor_speed = -70.0
            }
        });
        assert!(speed.len() == 1 && speed[0].contains("4200 rpm at 2.500 s"), "{speed:?}");
        let lost = cycle(&|k, r, _| {
            if at(k) {
                r.pressure_a = f64::NAN
            }
        });
        assert!(lost.len() == 1 && lost[0].contains("NaN bar at 2.500 s"), "{lost:?}");
    }
}
