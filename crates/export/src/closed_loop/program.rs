//! An exported controller as a separate process: compiled here, one exchange of inputs and outputs a control period.

use super::target::{Target, TargetError};
use crate::block::Block;
use crate::c::{Precision, files};
use crate::fmi::{System, Version, binary, unit};
use hydroboom_control::reference::preview::{DISTANT, PERIODS_AHEAD, PreviewAhead};
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::supervision::frame::{FrameInput, FrameOutput};
use hydroboom_description::Description;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Count of numbers sent to the program in a period, the gain factor first.
const GIVEN: usize = 1 + FrameInput::NAMES.len();
const SHOWN: usize = FrameOutput::NAMES.len();

/// Running process of an exported controller. Inputs and outputs of a control period are exchanged as binary `f64`
/// over pipes.
pub struct Program {
    name: &'static str,
    child: Child,
    given: ChildStdin,
    shown: ChildStdout,
    /// Preview of the reference, if the block has one.
    ahead: Option<(LookAhead, PreviewAhead<f64>)>,
}

/// Properties of a block's preview.
#[derive(Clone, Copy, Debug)]
struct LookAhead {
    /// Control period \[s\].
    period: f64,
    /// Length of the preview \[control periods\].
    length: usize,
}

/// Exported controller, compiled to a program that can be started several times.
#[derive(Clone, Debug)]
pub struct Compiled {
    name: &'static str,
    program: PathBuf,
    looks_ahead: Option<LookAhead>,
}

impl Compiled {
    /// Compiles a controller's C block with a C compiler, with files in `folder`. `name` is that in tables; `steps`
    /// are the integration steps of the simulated crane in a control period, 0 for a block without one.
    ///
    /// # Errors
    ///
    /// [`TargetError::Export`] if the block cannot be exported, [`TargetError::Program`] if it cannot be compiled.
    pub fn in_c(
        name: &'static str,
        block: &Block,
        steps: u32,
        compiler: &str,
        folder: &Path,
    ) -> Result<Self, TargetError> {
        let main = main(&block.name, steps);
        Self::of_source(name, block, &main, Precision::Double, (compiler, folder))
    }

    /// Compiles the C block of the scheduled LQR with `cc`, with a reference preview of up to `length` control
    /// periods.
    ///
    /// # Errors
    ///
    /// [`TargetError::Export`] if the block cannot be exported, [`TargetError::Program`] if it cannot be compiled.
    pub fn in_c_with_preview(
        name: &'static str,
        block: &Block,
        length: usize,
        precision: Precision,
        folder: &Path,
    ) -> Result<Self, TargetError> {
        let period = block.period.map_or(1e-3, |period| period.length);
        let main = main_with_preview(&block.name);
        let made = Self::of_source(name, block, &main, precision, ("cc", folder))?;
        Ok(Self { looks_ahead: Some(LookAhead { period, length }), ..made })
    }

    fn of_source(
        name: &'static str,
        block: &Block,
        main: &str,
        precision: Precision,
        (compiler, folder): (&str, &Path),
    ) -> Result<Self, TargetError> {
        let failed = |reason: String| TargetError::Program { target: name.into(), reason };
        let io = |error: std::io::Error| failed(error.to_string());
        let made = files(std::slice::from_ref(block), "controller", precision)?;
        std::fs::create_dir_all(folder).map_err(io)?;
        std::fs::write(folder.join("controller.h"), made.header).map_err(io)?;
        std::fs::write(folder.join("controller.c"), made.source).map_err(io)?;
        std::fs::write(folder.join("main.c"), main).map_err(io)?;
        let program = folder.join("controller");
        let output = Command::new(compiler)
            .args(["-std=c99", "-O2", "-ffp-contract=off", "-o"])
            .arg(&program)
            .args(["controller.c", "main.c"].map(|file| folder.join(file)))
            .arg("-lm")
            .output()
            .map_err(|error| failed(format!("{compiler}: {error}")))?;
        if !output.status.success() {
            return Err(failed(String::from_utf8_lossy(&output.stderr).into_owned()));
        }
        Ok(Self { name, program, looks_ahead: None })
    }

    /// Compiles a controller's FMU of FMI 2.0 with `cc` in a folder; a minimal co-simulation master runs it.
    ///
    /// # Errors
    ///
    /// [`TargetError::Export`] if the block cannot be exported, [`TargetError::Program`] if it cannot be compiled.
    pub fn in_fmu(
        name: &'static str,
        block: &Block,
        crane: &Description,
        folder: &Path,
    ) -> Result<Self, TargetError> {
        let failed = |reason: String| TargetError::Program { target: name.into(), reason };
        let io = |error: std::io::Error| failed(error.to_string());
        let made = unit(block, None, crane, Version::Two)?;
        let library = binary(&made, System::Linux, &folder.join("fmu"))
            .map_err(|error| failed(error.to_string()))?
            .ok_or_else(|| failed("no C compiler (cc) is here".into()))?;
        let description = made.files.iter().find(|(path, _)| path == "modelDescription.xml");
        let text = description.map_or("", |(_, text)| text.as_str());
        let attribute = |after: &str| -> Result<&str, TargetError> {
            let rest = text.split_once(after).map(|(_, rest)| rest);
            let value = rest.and_then(|rest| rest.split_once('"')).map(|(value, _)| value);
            value.ok_or_else(|| failed(format!("{after} is not in its description")))
        };
        let references = |names: &[&str]| -> Result<String, TargetError> {
            let of = |name: &&str| attribute(&format!("name=\"{name}\" valueReference=\""));
            Ok(names.iter().map(of).collect::<Result<Vec<_>, _>>()?.join(", "))
        };
        let period = block.period.map_or(1e-3, |period| period.length);
        let source = MASTER
            .replace("GIVEN", &GIVEN.to_string())
            .replace("SHOWN", &SHOWN.to_string())
            .replace("TOKEN", attribute("guid=\"")?)
            .replace("GAIN", &references(&["controller_proportional_per_s"])?)
            .replace("INPUTS", &references(&FrameInput::NAMES)?)
            .replace("OUTPUTS", &references(&FrameOutput::NAMES)?)
            .replace("PERIOD", &format!("{period:?}"))
            .replace("LIBRARY", &format!("{:?}", folder.join("controller.so")));
        std::fs::create_dir_all(folder).map_err(io)?;
        std::fs::write(folder.join("controller.so"), library).map_err(io)?;
        std::fs::write(folder.join("master.c"), source).map_err(io)?;
        let program = folder.join("master");
        let output = Command::new("cc")
            .args(["-std=gnu99", "-O1", "-o"])
            .arg(&program)
            .arg(folder.join("master.c"))
            .arg("-ldl")
            .output()
            .map_err(|error| failed(format!("cc: {error}")))?;
        if !output.status.success() {
            return Err(failed(String::from_utf8_lossy(&output.stderr).into_owned()));
        }
        Ok(Self { name, program, looks_ahead: None })
    }

    /// Starts the program as a child process, with the controller in its initial state.
    ///
    /// # Errors
    ///
    /// [`TargetError::Program`] if it cannot be started.
    pub fn start(&self) -> Result<Program, TargetError> {
        let failed = |reason: String| TargetError::Program { target: self.name.into(), reason };
        let mut child = Command::new(&self.program)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| failed(error.to_string()))?;
        match (child.stdin.take(), child.stdout.take()) {
            (Some(given), Some(shown)) => {
                let ahead = self.looks_ahead.map(|of| (of, PreviewAhead::unknown()));
                Ok(Program { name: self.name, child, given, shown, ahead })
            }
            _ => Err(failed("it has no pipes".into())),
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // normally the program ends when its input is closed; kill covers the others
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Target for Program {
    fn name(&self) -> &'static str {
        self.name
    }

    fn look_ahead(&mut self, at: &dyn Fn(f64) -> SetPoint<f64>) {
        if let Some((LookAhead { period, length }, ahead)) = &mut self.ahead {
            *ahead = PreviewAhead::new(*period, *length, at);
        }
    }

    fn period(
        &mut self,
        input: &FrameInput<f64>,
        gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError> {
        let failed = |error: std::io::Error| TargetError::Program {
            target: self.name.into(),
            reason: error.to_string(),
        };
        let numbers = std::iter::once(gain).chain(input.to_array());
        let ahead = self.ahead.iter().flat_map(|(_, ahead)| {
            let numbers = ahead.position.iter().chain(&ahead.velocity).chain(&ahead.distant);
            numbers.chain(std::iter::once(&ahead.length)).copied()
        });
        let bytes: Vec<u8> = numbers.chain(ahead).flat_map(f64::to_ne_bytes).collect();
        self.given.write_all(&bytes).map_err(failed)?;
        self.given.flush().map_err(failed)?;
        let mut bytes = [0; 8 * SHOWN];
        self.shown.read_exact(&mut bytes).map_err(failed)?;
        let mut values = [0.0; SHOWN];
        for (value, bytes) in values.iter_mut().zip(bytes.chunks_exact(8)) {
            *value = f64::from_ne_bytes(bytes.try_into().unwrap_or_default());
        }
        Ok(FrameOutput::from_array(values))
    }
}

/// Main function around a block: reads inputs, writes the frame's outputs.
fn main(block: &str, steps: u32) -> String {
    let name = format!("hb_{block}");
    let fields = |names: &[&str], of: &dyn Fn(usize, &str) -> String| -> String {
        names.iter().enumerate().map(|(k, name)| of(k, name)).collect()
    };
    let given =
        fields(&FrameInput::NAMES, &|k, field| format!("        u.{field} = given[{}];\n", k + 1));
    let shown =
        fields(&FrameOutput::NAMES, &|k, field| format!("        shown[{k}] = y.{field};\n"));
    let moves = match steps {
        0 => String::new(),
        steps => format!(
            "        for (k = 0; k < {steps}; k++) {{\n            {name}_step(&s);\n        }}\n"
        ),
    };
    format!(
        "#include \"controller.h\"\n#include <stdio.h>\nint main(void)\n{{\n    {name}_parameters p;\n    {name}_prepared c;\n    \
         {name}_state s;\n    {name}_input u;\n    {name}_output y;\n    double given[{GIVEN}], shown[{SHOWN}], gain = 1.0;\n    double proportional;\n    int k = 0;\n    \
         (void)k;\n    {name}_describe(&p);\n    proportional = p.controller_proportional_per_s;\n    {name}_prepare(&p, &c);\n    {name}_start(&s);\n    \
         while (fread(given, sizeof given, 1, stdin) == 1) {{\n        if (given[0] != gain) {{\n            gain = given[0];\n            \
         p.controller_proportional_per_s = gain * proportional;\n            {name}_prepare(&p, &c);\n        }}\n{given}        {name}_update(&c, &s, &u, &y);\n{moves}{shown}        \
         if (fwrite(shown, sizeof shown, 1, stdout) != 1 || fflush(stdout) != 0) {{\n            return 1;\n        }}\n    }}\n    return 0;\n}}\n"
    )
}

/// Main function around a block with a preview and without gains: reads the frame's inputs, then the preview.
fn main_with_preview(block: &str) -> String {
    let name = format!("hb_{block}");
    let count = GIVEN + 2 * PERIODS_AHEAD + DISTANT + 1;
    let take = |table: &str, count: usize| {
        format!(
            "        for (k = 0; k < {count}; k++) {{\n            u.preview_{table}[k] = (hb_real)*next++;\n        }}\n"
        )
    };
    let preview = take("position", PERIODS_AHEAD)
        + &take("velocity", PERIODS_AHEAD)
        + &take("distant_position", DISTANT);
    let fields = FrameInput::NAMES.iter().enumerate();
    let given: String = fields
        .map(|(k, field)| format!("        u.{field} = (hb_real)given[{}];\n", k + 1))
        .collect();
    let fields = FrameOutput::NAMES.iter().enumerate();
    let shown: String =
        fields.map(|(k, field)| format!("        shown[{k}] = y.{field};\n")).collect();
    format!(
        "#include \"controller.h\"\n#include <stdio.h>\nint main(void)\n{{\n    static {name}_state s;\n    \
         static {name}_input u;\n    static {name}_output y;\n    static double given[{count}];\n    double shown[{SHOWN}];\n    int k;\n    \
         {name}_start(&s);\n    while (fread(given, sizeof given, 1, stdin) == 1) {{\n        const double *next = given + {GIVEN};\n{given}{preview}        \
         u.preview_length = (hb_real)*next;\n        {name}_update(&s, &u, &y);\n{shown}        \
         if (fwrite(shown, sizeof shown, 1, stdout) != 1 || fflush(stdout) != 0) {{\n            return 1;\n        }}\n    }}\n    return 0;\n}}\n"
    )
}

/// A minimal FMI 2.0 master: sets the inputs, does one step of a control period, gets the outputs.
const MASTER: &str = r#"#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

typedef void *component;
typedef void (*logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct { logger log; void *(*allocate)(size_t, size_t); void (*release)(void *); void *finished; void *environment; } callbacks;

static void quiet(void *e, const char *n, int s, const char *c, const char *m, ...)
{
    (void)e; (void)n; (void)s; (void)c; (void)m;
}

int main(void)
{
    static const unsigned inputs[] = { INPUTS }, outputs[] = { OUTPUTS }, gains[] = { GAIN };
    static const callbacks back = { quiet, calloc, free, NULL, NULL };
    void *library = dlopen(LIBRARY, RTLD_NOW);
    double given[GIVEN], shown[SHOWN], gain = 1.0, proportional;
    long k = 0;
    component i;
    if (library == NULL) {
        return 2;
    }
    component (*make)(const char *, int, const char *, const char *, const callbacks *, int, int);
    int (*enter)(component), (*leave)(component), (*experiment)(component, int, double, double, int, double);
    int (*get)(component, const unsigned *, size_t, double *), (*set)(component, const unsigned *, size_t, const double *);
    int (*step)(component, double, double, int);
    *(void **)&make = dlsym(library, "fmi2Instantiate");
    *(void **)&experiment = dlsym(library, "fmi2SetupExperiment");
    *(void **)&enter = dlsym(library, "fmi2EnterInitializationMode");
    *(void **)&leave = dlsym(library, "fmi2ExitInitializationMode");
    *(void **)&get = dlsym(library, "fmi2GetReal");
    *(void **)&set = dlsym(library, "fmi2SetReal");
    *(void **)&step = dlsym(library, "fmi2DoStep");
    i = make("controller", 1, "TOKEN", "", &back, 0, 0);
    if (i == NULL || experiment(i, 0, 0.0, 0.0, 0, 0.0) != 0 || enter(i) != 0 || leave(i) != 0) {
        return 3;
    }
    if (get(i, gains, 1, &proportional) != 0) {
        return 4;
    }
    while (fread(given, sizeof given, 1, stdin) == 1) {
        if (given[0] != gain) {
            double tuned = given[0] * proportional;
            gain = given[0];
            /* a gain that is no number is refused, and the one before stays */
            (void)set(i, gains, 1, &tuned);
        }
        if (set(i, inputs, GIVEN - 1, given + 1) != 0 || step(i, PERIOD * (double)k, PERIOD, 0) != 0) {
            return 5;
        }
        k++;
        if (get(i, outputs, SHOWN, shown) != 0 || fwrite(shown, sizeof shown, 1, stdout) != 1 || fflush(stdout) != 0) {
            return 6;
        }
    }
    return 0;
}
"#;
