//! Choice of the machine that represents the real crane beside its model.

use crate::crane_file::{CraneFile, self_contained, text};
use crate::{origin, output};
use hydroboom_description::{Description, Difference, FilledIn, UIA_VIRTUAL, by_weight};
use hydroboom_design::benchmark_design::Gains;
use miette::Result;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::path::Path;

/// Largest number of printed differences; JSON contains all.
const PRINTED: usize = 10;

/// Prefix of the motion's keys: an override of one applies to model and machine.
const MOTION: &str = "motion.";

/// Source of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The paper's virtual crane, embedded, if no crane file is named.
    Embedded,
    /// Virtual crane of the named crane file.
    CraneFile,
    /// Crane file of its own.
    MachineFile,
    /// Another process, on the local interface.
    Udp,
    /// Devices on a bus.
    EtherCat,
    /// The model itself or with overrides, with ideal equipment.
    Model,
}

impl Source {
    /// Name of the source in JSON.
    fn name(self) -> &'static str {
        match self {
            Self::Embedded => "embedded",
            Self::CraneFile => "crane file",
            Self::MachineFile => "plant file",
            Self::Udp => "udp",
            Self::EtherCat => "ethercat",
            Self::Model => "model",
        }
    }

    /// Whether only the sensors of the machine are known.
    pub fn is_attached(self) -> bool {
        matches!(self, Self::Udp | Self::EtherCat)
    }
}

/// Model, and the machine that represents the real crane beside it.
#[derive(Clone, Debug)]
pub struct MachineChoice {
    /// Model, which the controllers use.
    pub model: Description,
    /// The machine; for an attached one the model with typical equipment.
    pub machine: Description,
    /// Source of the machine.
    pub source: Source,
    /// Missing keys of the machine's crane file with their typical values.
    filled_in: Vec<FilledIn>,
    /// Differences between machine and model, the most important first.
    differences: Vec<Difference>,
    /// Options of `hydroboom machine` for the same machine.
    arguments: Vec<OsString>,
    /// Where a machine is attached, as it was named.
    address: Option<String>,
    /// Whether an attached machine says that it is simulated.
    is_simulated: bool,
}

impl MachineChoice {
    /// Model of `crane` with its machine. The machine is the file `machine` if named, else the virtual
    /// crane of the named crane file, else the paper's virtual crane.
    ///
    /// Filled-in values, and the differences of a named machine, are printed on standard error.
    ///
    /// # Errors
    ///
    /// If a crane file or an override is invalid, or a crane is valve-controlled.
    pub fn read(crane: &CraneFile, machine: Option<&Path>) -> Result<Self> {
        Self::of(crane.read()?, crane, machine)
    }

    /// The same, where `plant` may also be a file with a `[set]` table: overrides of the default machine.
    ///
    /// # Errors
    ///
    /// As of [`read`](Self::read).
    pub fn read_plant(crane: &CraneFile, plant: Option<&Path>) -> Result<Self> {
        let Some(path) = plant else { return Self::read(crane, None) };
        let content = text(path)?;
        match content.contains("[set]") {
            true => {
                let choice = Self::read(crane, None)?;
                let plant = choice.machine.overridden(&path.display().to_string(), &content)?.0;
                Ok(choice.with_machine(plant))
            }
            false => Self::read(crane, Some(path)),
        }
    }

    /// The same for a model that was read from `crane`.
    ///
    /// # Errors
    ///
    /// As of [`read`](Self::read), for the machine.
    pub fn of(model: Description, crane: &CraneFile, machine: Option<&Path>) -> Result<Self> {
        let nothing = Vec::new();
        // overrides of the motion apply to both
        let motion: Vec<&str> = crane
            .overrides()
            .iter()
            .map(String::as_str)
            .filter(|set| set.trim_start().starts_with(MOTION))
            .collect();
        let moved = |mut machine: Description| -> Result<Description> {
            machine.set_together_within_range(motion.iter().copied())?;
            Ok(machine)
        };
        let sets = || motion.iter().flat_map(|set| [OsString::from("--set"), (*set).into()]);
        let (machine, source, filled_in, arguments) = match (machine, crane.path()) {
            (Some(path), _) => {
                let machine = Description::parse(&path.display().to_string(), &text(path)?)?;
                let machine = self_contained(moved(machine)?)?;
                let arguments = ["--crane".into(), path.into()].into_iter().chain(sets()).collect();
                (machine, Source::MachineFile, nothing, arguments)
            }
            (None, Some(_)) => {
                let (machine, filled_in) = model.virtual_crane();
                let mut arguments = crane.arguments();
                arguments.push("--virtual".into());
                (machine, Source::CraneFile, filled_in, arguments)
            }
            (None, None) => {
                let machine = moved(Description::uia_virtual()?)?;
                origin::embedded(&machine.name, UIA_VIRTUAL);
                (machine, Source::Embedded, nothing, sets().collect())
            }
        };
        let differences = by_weight(model.differences(&machine));
        let address = None;
        let is_simulated = false;
        let choice = Self {
            model,
            machine,
            source,
            filled_in,
            differences,
            arguments,
            address,
            is_simulated,
        };
        if crane.overrides().len() > motion.len() && source != Source::CraneFile {
            output::note(&format!(
                "--set is of the model only: the plant \"{}\" keeps the values of its own file",
                choice.name()
            ));
        }
        choice.notes().iter().for_each(|note| output::note(note));
        Ok(choice)
    }

    /// The model itself as the machine, with ideal equipment.
    pub fn model_itself(model: &Description) -> Self {
        let model = model.without_equipment();
        Self {
            machine: model.clone(),
            model,
            source: Source::Model,
            filled_in: Vec::new(),
            differences: Vec::new(),
            arguments: Vec::new(),
            address: None,
            is_simulated: false,
        }
    }

    /// Machine attached at an address. Its parameters are unknown: for checks before a run the model with
    /// typical equipment represents it.
    pub fn attached(model: Description, source: Source, address: String) -> Self {
        let (machine, _) = model.virtual_crane();
        Self {
            machine,
            model,
            source,
            filled_in: Vec::new(),
            differences: Vec::new(),
            arguments: Vec::new(),
            address: Some(address),
            is_simulated: false,
        }
    }

    /// The same, of an attached machine that reports whether it is simulated.
    pub fn reported_as_simulated(self, is_simulated: bool) -> Self {
        Self { is_simulated, ..self }
    }

    /// The same with another machine, changed by overrides.
    pub fn with_machine(self, machine: Description) -> Self {
        let differences = by_weight(self.model.differences(&machine));
        Self { machine, differences, ..self }
    }

    /// The same with other gains of the benchmark controller, in model and machine.
    pub fn with_benchmark_gains(self, gains: &Gains) -> Self {
        let (model, machine) = (gains.put(&self.model), gains.put(&self.machine));
        Self { model, ..self }.with_machine(machine)
    }

    /// Whether the machine is a virtual crane with its equipment.
    pub fn is_virtual(&self) -> bool {
        matches!(self.source, Source::Embedded | Source::CraneFile)
    }

    /// Name of the machine in tables and messages.
    pub fn name(&self) -> String {
        match (&self.address, self.source) {
            (Some(address), _) if self.is_simulated => format!("simulated machine at {address}"),
            (Some(address), _) => format!("machine at {address}"),
            (None, Source::CraneFile) => format!("virtual crane of {}", self.model.name),
            (None, _) => self.machine.name.clone(),
        }
    }

    /// Options of `hydroboom machine` for the same machine in another process.
    pub fn arguments(&self) -> &[OsString] {
        &self.arguments
    }

    /// The most important differences in the order of the file, and the number of the others.
    pub fn most_important(&self) -> (Vec<Difference>, usize) {
        let printed = self.differences.len().min(PRINTED);
        let mut important = self.model.differences(&self.machine);
        important.retain(|difference| self.differences[..printed].contains(difference));
        (important, self.differences.len() - printed)
    }

    /// Remark if the machine equals the model except for its equipment; none if it differs.
    pub fn equality(&self) -> Option<&'static str> {
        if self.source.is_attached() {
            return None;
        }
        if self.differences.is_empty() {
            return Some(
                "the plant is equal to the model: errors of the model, which a real machine adds, are not in the tracking errors",
            );
        }
        self.differences.iter().all(Difference::is_of_equipment).then_some(
            "the plant is equal to the model but for drive, valve, sensors and fieldbus: other errors of the model, \
             which a real machine adds, are not in the tracking errors",
        )
    }

    /// The machine as JSON: name, source, digest, filled-in values, and all differences from the model.
    pub fn json(&self) -> Value {
        let filled_in = self.filled_in.iter().map(|f| {
            json!({ "key": f.key.path(), "value": f.value, "unit": f.key.unit, "source": f.source })
        });
        let differences = self
            .differences
            .iter()
            .map(|d| json!({ "key": d.key, "model": d.here, "plant": d.there, "unit": d.unit }));
        json!({
            "name": self.name(), "is_simulated": self.is_simulated || !self.source.is_attached(), "from": self.source.name(), "digest": self.machine.digest(),
            "equals_model": self.equality().is_some(), "remark": self.equality(),
            "filled_in": filled_in.collect::<Vec<_>>(),
            "differences": differences.collect::<Vec<_>>(),
        })
    }

    /// Notes on filled-in values, and on the differences of a named machine.
    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.filled_in.is_empty() {
            let keys: Vec<String> = self.filled_in.iter().map(FilledIn::to_string).collect();
            notes.push(format!(
                "the plant is the {}. Typical values replace entries that its file omits:\n  {}",
                self.name(),
                keys.join("\n  ")
            ));
        }
        if self.source == Source::MachineFile && !self.differences.is_empty() {
            notes.push(format!(
                "the plant \"{}\" differs from the model \"{}\" in\n  {}",
                self.name(),
                self.model.name,
                shortened(&self.differences).join("\n  ")
            ));
        }
        notes
    }
}

/// The most important differences, a line each, and the number of the others.
fn shortened(differences: &[Difference]) -> Vec<String> {
    let printed = &differences[..differences.len().min(PRINTED)];
    let short = |text: &str| text.parse().map_or_else(|_| text.to_string(), output::number);
    let line = |d: &Difference| {
        format!("{}: {} in the model, {} here", d.key, short(&d.here), short(&d.there))
    };
    let mut lines: Vec<String> = printed.iter().map(line).collect();
    if differences.len() > PRINTED {
        lines.push(format!("and {} more: --json lists them", differences.len() - PRINTED));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_differences_are_cut_short_and_few_are_not() {
        let model = Description::uia_single_boom().unwrap();
        let of = |machine: &Description| shortened(&by_weight(model.differences(machine)));
        let lines = of(&Description::uia_virtual().unwrap());
        assert_eq!(lines.len(), PRINTED + 1);
        assert!(
            lines[PRINTED].starts_with("and ") && lines[PRINTED].contains("--json"),
            "{lines:?}"
        );
        let mut heavy = model.clone();
        heavy.set("payload.mass_kg=340").unwrap();
        assert_eq!(of(&heavy), ["payload.mass_kg: 307 in the model, 340 here"]);
        assert!(of(&model).is_empty());
    }
}
