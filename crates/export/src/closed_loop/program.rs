//! An exported controller as a program of its own: compiled here, asked period by period.

use super::target::{Target, TargetError};
use crate::block::Block;
use crate::c::{Precision, files};
use hydroboom_control::supervision::{FrameInput, FrameOutput};
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Numbers that go to the program in a period, the gain's factor first, and come back.
const GIVEN: usize = 1 + FrameInput::NAMES.len();
const SHOWN: usize = FrameOutput::NAMES.len();

/// A program that answers each period's inputs with outputs, as raw doubles.
pub struct Program {
    name: &'static str,
    child: Child,
    given: ChildStdin,
    shown: ChildStdout,
}

impl Program {
    /// A controller's block in C, compiled by `cc` in a folder; `steps` of its simulated crane make a
    /// control period, none where it simulates nothing.
    ///
    /// # Errors
    ///
    /// [`TargetError`] when it cannot be exported or compiled.
    pub fn in_c(
        name: &'static str,
        block: &Block,
        steps: u32,
        folder: &Path,
    ) -> Result<Self, TargetError> {
        let failed = |reason: String| TargetError::Program { target: name.into(), reason };
        let io = |error: std::io::Error| failed(error.to_string());
        let made = files(std::slice::from_ref(block), "controller", Precision::Double)?;
        std::fs::create_dir_all(folder).map_err(io)?;
        std::fs::write(folder.join("controller.h"), made.header).map_err(io)?;
        std::fs::write(folder.join("controller.c"), made.source).map_err(io)?;
        std::fs::write(folder.join("main.c"), main(&block.name, steps)).map_err(io)?;
        let program = folder.join("controller");
        let output = Command::new("cc")
            .args(["-std=c99", "-O2", "-ffp-contract=off", "-o"])
            .arg(&program)
            .args(["controller.c", "main.c"].map(|file| folder.join(file)))
            .arg("-lm")
            .output()
            .map_err(|error| failed(format!("cc: {error}")))?;
        if !output.status.success() {
            return Err(failed(String::from_utf8_lossy(&output.stderr).into_owned()));
        }
        Self::started(name, &mut Command::new(program))
    }

    /// A program that speaks so already.
    ///
    /// # Errors
    ///
    /// [`TargetError`] when it cannot be started.
    pub fn started(name: &'static str, command: &mut Command) -> Result<Self, TargetError> {
        let failed = |reason: String| TargetError::Program { target: name.into(), reason };
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| failed(error.to_string()))?;
        match (child.stdin.take(), child.stdout.take()) {
            (Some(given), Some(shown)) => Ok(Self { name, child, given, shown }),
            _ => Err(failed("it has no pipes".into())),
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // it ends with its input; one that does not is of no use to anybody
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Target for Program {
    fn name(&self) -> &'static str {
        self.name
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
        let bytes: Vec<u8> = numbers.flat_map(|v| v.to_ne_bytes()).collect();
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

/// A program around a block: what is read is its input, the frame's outputs are written.
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
