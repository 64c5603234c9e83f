//! Robustness cases: `robust COURSE LIST`: each line of the list is `name|sets of crane file and machine|sets of the machine alone|sets of the crane file alone`.
#![allow(missing_docs, clippy::all, clippy::pedantic)]
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::metrics::Metrics;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::closed_loop::simulation::simulate_closed_loop;

fn main() {
    let a: Vec<String> = std::env::args().collect();
    let text = std::fs::read_to_string(&a[2]).unwrap();
    let lines: Vec<&str> = text.lines().filter(|l| !l.is_empty()).collect();
    let next = std::sync::atomic::AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    let Some(line) = lines.get(k) else { break };
                    println!("{}", case(&a[1], line));
                }
            });
        }
    });
}

fn case(course: &str, line: &str) -> String {
    let mut parts =
        line.split('|').map(|p| p.split(';').filter(|s| !s.is_empty()).collect::<Vec<_>>());
    let name = line.split('|').next().unwrap();
    parts.next();
    let mut model = Description::uia_single_boom().unwrap();
    let mut crane = Description::uia_virtual().unwrap();
    if let Ok(path) = std::env::var("CRANE") {
        model = Description::parse(&path, &std::fs::read_to_string(&path).unwrap()).unwrap();
        crane = model.virtual_crane().0;
    }
    for set in parts.next().unwrap_or_default() {
        if let Err(e) = model.set(set) {
            return format!("{name}: {e}");
        }
        if let Err(e) = crane.set(set) {
            return format!("{name}: {e}");
        }
    }
    for set in parts.next().unwrap_or_default() {
        if let Err(e) = crane.set(set) {
            return format!("{name}: {e}");
        }
    }
    for set in parts.next().unwrap_or_default() {
        if let Err(e) = model.set(set) {
            return format!("{name}: {e}");
        }
    }
    let choice = match course {
        "fast" => CourseChoice::Motion(model.numbers.fast),
        "slow" => CourseChoice::Motion(model.numbers.slow),
        o => CourseChoice::Scenario(o.into()),
    };
    let course = choice.of(&crane).unwrap();
    let mut out = format!("{name:44}");
    for s in [Strategy::ScheduledLqr, Strategy::BenchmarkClosedLoop] {
        let (mut m, mut sum, mut n, mut peak, mut ripple, mut nr) =
            (Metrics::new(), 0.0, 0.0, 0.0_f64, 0.0, 0.0);
        let mut last: Option<f64> = None;
        let end = simulate_closed_loop(&model, &crane, s, course.as_ref(), |x| {
            m.add(x);
            let e = x.truth.outputs.stroke - x.reference.position;
            sum += e * e;
            n += 1.0;
            peak = if e.abs() > peak.abs() { e } else { peak };
            if x.reference.velocity == 0.0 && x.time > 1.0 {
                if let Some(l) = last {
                    ripple += (x.command.motor_speed - l).powi(2);
                    nr += 1.0;
                }
                last = Some(x.command.motor_speed);
            } else {
                last = None;
            }
            if std::env::var("TRACE").is_ok()
                && s == Strategy::ScheduledLqr
                && ((x.time * 1e3).round() as u64) % 20 < 3
            {
                eprintln!(
                    "{:.3} ref {:.2} v {:.1} e {:.3} u {:.1} n {:.1} pA {:.2}",
                    x.time,
                    x.reference.position * 1e3,
                    x.reference.velocity * 1e3,
                    e * 1e3,
                    x.command.motor_speed * 60.0,
                    x.truth.motor_speed * 60.0,
                    x.truth.outputs.pressure_a * 1e-5
                );
            }
            Ok(())
        });
        let end = end.map(|_| String::new()).unwrap_or_else(|e| format!(" ENDED {e}"));
        out += &format!(
            "  {:8.3} mm (peak {:8.2}) osc {:5} ripple {:6.2} rpm{end}",
            1e3 * f64::sqrt(sum / n),
            1e3 * peak,
            m.oscillates(),
            60.0 * f64::sqrt(ripple / f64::max(nr, 1.0))
        );
    }
    out
}
