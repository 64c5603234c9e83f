//! Independent plant as a process, and a controller acting on it.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::OnceLock;

/// Control period \[s\].
const PERIOD: f64 = 1e-3;

/// Measurements of the plant through sensors and fieldbus, one control period late.
#[derive(Clone, Copy, Debug)]
pub struct Readings {
    /// Time since the start \[s\].
    pub time: f64,
    /// Piston position \[m\].
    pub stroke: f64,
    /// Pressure on the piston side \[Pa\].
    pub pressure_a: f64,
    /// Pressure on the rod side \[Pa\].
    pub pressure_b: f64,
    /// Pressure on pump side A \[Pa\].
    pub pressure_pump_a: f64,
    /// Pressure on pump side B \[Pa\].
    pub pressure_pump_b: f64,
    /// Pressure of the accumulator \[Pa\].
    pub pressure_accumulator: f64,
    /// Motor speed \[rev/s\].
    pub motor_speed: f64,
}

/// One control period.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Measurements.
    pub readings: Readings,
    /// True piston position now \[m\].
    pub true_stroke: f64,
}

/// Change of the payload to `mass` \[kg\] at `time` \[s\].
#[derive(Clone, Copy, Debug)]
pub struct PayloadChange {
    /// Time \[s\].
    pub time: f64,
    /// New payload \[kg\].
    pub mass: f64,
}

/// Plant in a process of its own.
pub struct IndependentPlant {
    process: Child,
    requests: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
    periods: u32,
    sample: Sample,
}

impl IndependentPlant {
    /// Plant of the virtual crane's file, at rest at the start of its motion with the load-holding valve
    /// open. `assignments` override values of the file, as `section.key=VALUE`.
    pub fn start(assignments: &[&str]) -> Self {
        let crane_file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../cranes/uia-virtual.toml");
        let mut process = Command::new(program())
            .arg(crane_file)
            .arg(format!("controller.control_period_ms={}", 1e3 * PERIOD))
            .args(assignments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let requests = process.stdin.take();
        let mut answers = BufReader::new(process.stdout.take().unwrap());
        let sample = answered(&mut answers, 0.0);
        Self { process, requests, answers, periods: 0, sample }
    }

    /// Advances by one control period with the commanded motor speed \[rev/s\].
    pub fn run(&mut self, motor_speed: f64) -> Sample {
        self.request("run", motor_speed);
        self.periods += 1;
        let time = f64::from(self.periods) * PERIOD;
        self.sample = answered(&mut self.answers, time);
        self.sample
    }

    /// Sets the payload \[kg\].
    pub fn set_payload(&mut self, mass: f64) {
        self.request("payload", mass);
    }

    /// De-energises the 3/2 valve: the load-holding valves close.
    pub fn hold_load(&mut self) {
        self.request("valve", 0.0);
    }

    /// Adds to the boom's angular velocity \[rad/s\].
    pub fn add_impulse(&mut self, rate: f64) {
        self.request("impulse", rate);
    }

    /// Runs a controller, a function from measurements to motor speed \[rev/s\], over `duration` \[s\].
    pub fn control(
        &mut self,
        duration: f64,
        payload_changes: &[PayloadChange],
        mut controller: impl FnMut(&Readings) -> f64,
    ) -> Vec<Sample> {
        let mut samples = vec![self.sample];
        let mut changes = payload_changes.iter().peekable();
        for _ in 0..(duration / PERIOD).round() as usize {
            while let Some(change) = changes.next_if(|c| c.time <= self.sample.readings.time) {
                self.set_payload(change.mass);
            }
            let motor_speed = controller(&self.sample.readings);
            samples.push(self.run(motor_speed));
        }
        samples
    }

    fn request(&mut self, name: &str, value: f64) {
        let requests = self.requests.as_mut().unwrap();
        writeln!(requests, "{name} {value:e}").unwrap();
    }
}

impl Drop for IndependentPlant {
    fn drop(&mut self) {
        // the process ends at the end of its input
        drop(self.requests.take());
        let _ = self.process.wait();
    }
}

/// RMS true tracking error over all samples \[m\].
pub fn rms_error(samples: &[Sample], reference: impl Fn(f64) -> f64) -> f64 {
    let square = |s: &Sample| (s.true_stroke - reference(s.readings.time)).powi(2);
    (samples.iter().map(square).sum::<f64>() / samples.len() as f64).sqrt()
}

fn answered(answers: &mut BufReader<ChildStdout>, time: f64) -> Sample {
    let mut line = String::new();
    answers.read_line(&mut line).unwrap();
    let values: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
    let [
        stroke,
        pressure_a,
        pressure_b,
        pressure_pump_a,
        pressure_pump_b,
        pressure_accumulator,
        motor_speed,
        true_stroke,
    ] = values[..]
    else {
        panic!("the plant ended; its message is on the standard error: {line:?}");
    };
    let readings = Readings {
        time,
        stroke,
        pressure_a,
        pressure_b,
        pressure_pump_a,
        pressure_pump_b,
        pressure_accumulator,
        motor_speed,
    };
    Sample { readings, true_stroke }
}

/// The C program, compiled once with warnings as errors.
fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("independent_plant");
        std::fs::create_dir_all(&folder).unwrap();
        let source =
            concat!(env!("CARGO_MANIFEST_DIR"), "/tests/integration/independent_plant/crane.c");
        // compiled under another name and renamed, because tests in other processes may compile it too
        let program = folder.join("crane");
        let fresh = folder.join(format!("crane-{}", std::process::id()));
        let output = Command::new("cc")
            .args([
                "-std=c99",
                "-Wall",
                "-Wextra",
                "-Werror",
                "-pedantic",
                "-O2",
                "-ffp-contract=off",
            ])
            .args([source, "-lm", "-o"])
            .arg(&fresh)
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::rename(&fresh, &program).unwrap();
        program
    })
}
