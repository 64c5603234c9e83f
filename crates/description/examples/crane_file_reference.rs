//! Reference of all keys of a crane file, as Markdown.
//!
//! ```sh
//! cargo run -p hydroboom-description --example crane_file_reference > docs/reference/crane-file.md
//! ```

use hydroboom_description::schema::{
    ChoiceKey, CircuitChoice, KEYS, Key, OTHER_KEYS, OtherKey, StructureChoice,
};
use hydroboom_description::section::SECTIONS;
use hydroboom_description::{Choices, Description, DescriptionError};

/// Longest line outside of tables \[letters\].
const LINE: usize = 118;

/// Largest number of links; a crane of so many has the keys of each.
const LINKS: usize = 3;

const INTRODUCTION: &str = "\
Generated from the schema in `crates/description/src` by
`cargo run -p hydroboom-description --example crane_file_reference`.

A crane file is TOML: `key = value` lines under `[section]` headings.
[Describe my crane](../how-to/describe-my-crane.md) shows how to write one. A number may state its range on this
machine, provenance and source:

```toml
mass_kg = { value = 307.0, range = [0.0, 370.0], provenance = \"printed\", source = \"Table 4, m\" }
```

Names end with the unit. *Allowed* has the smallest and the largest accepted value, in that unit; `hydroboom check`
also tests keys against each other. *Default* applies where a file leaves the key out; without one the key is required.
The source of a default is in the meaning. *Example* has the value of a shipped crane with its provenance and source:
`cranes/uia-single-boom.toml`, or else `uia-virtual.toml` (virtual) or `patu-lift.toml` (lift). Numbers of valves are
those of the paper's circuit, symbols those of [notation](notation.md).
";

fn main() -> Result<(), DescriptionError> {
    print!("{}", page()?);
    Ok(())
}

/// The page with all sections.
///
/// # Errors
///
/// Of an embedded crane file.
pub fn page() -> Result<String, DescriptionError> {
    let examples = Examples::read()?;
    let links: Vec<String> =
        SECTIONS.iter().map(|section| format!("[{0}](#{0})", section.name)).collect();
    let mut page =
        format!("# Keys of a crane file\n\n{INTRODUCTION}\n{}\n", wrapped(&links.join(", ")));
    for section in SECTIONS {
        let rows = rows(section.name, &examples);
        let all = rows.iter().map(|row| row.only_with).collect::<Vec<_>>();
        let shared = all.first().copied().filter(|first| all.iter().all(|each| each == first));
        let mut sentence = section.meaning.to_string();
        if let Some(kinds) = shared.and_then(Kinds::sentence) {
            sentence += &format!(" {kinds}");
        }
        page += &format!("\n## `[{}]`\n\n{}\n\n", section.name, wrapped(&sentence));
        page +=
            "| key | unit | allowed | default | meaning | example |\n|---|---|---|---|---|---|\n";
        for row in rows {
            let mut meaning = row.meaning;
            if let (None, Some(kinds)) = (shared, row.only_with.sentence()) {
                meaning += &format!(". {kinds}");
            }
            let cells = [
                format!("`{}`", row.name),
                row.unit,
                row.allowed,
                row.default,
                meaning,
                row.example,
            ];
            page += &format!("| {} |\n", cells.map(|cell| in_table(&cell)).join(" | "));
        }
    }
    Ok(page)
}

/// One key on the page.
struct Row {
    name: &'static str,
    unit: String,
    allowed: String,
    default: String,
    meaning: String,
    example: String,
    only_with: Kinds,
}

/// Rows of a section: other keys and choices, then numbers in the order of the schema.
fn rows(section: &str, examples: &Examples) -> Vec<Row> {
    let of_section = |path: &'static str| {
        path.split_once('.').filter(|(its, _)| *its == section).map(|(_, name)| name)
    };
    let other = OTHER_KEYS.iter().filter_map(|key: &OtherKey| {
        Some(Row {
            name: of_section(key.path)?,
            unit: String::new(),
            allowed: key.allowed.into(),
            default: key.absent.unwrap_or("required").into(),
            meaning: key.meaning.into(),
            example: String::new(),
            only_with: Kinds::of(key.path, examples),
        })
    });
    let choices = Choices::KEYS.into_iter().filter_map(|key: ChoiceKey| {
        let names = key
            .names
            .iter()
            .map(|(name, meaning)| format!("`{name}`: {}", meaning.trim_end_matches('.')));
        Some(Row {
            name: of_section(key.path)?,
            unit: String::new(),
            allowed: key
                .names
                .iter()
                .map(|(name, _)| format!("`{name}`"))
                .collect::<Vec<_>>()
                .join(", "),
            default: key.absent.map_or("required".into(), |name| format!("`{name}`")),
            meaning: format!("{} {}", key.meaning, names.collect::<Vec<_>>().join("; ")),
            example: examples.choice(key.path),
            only_with: Kinds::of(key.path, examples),
        })
    });
    let numbers = KEYS.iter().filter(|key| key.section == section).map(|key| Row {
        name: key.name,
        unit: key.unit.into(),
        allowed: format!("{} to {}", number(key.low), number(key.high)),
        default: key.absent.map_or("required".into(), number),
        meaning: key.meaning.into(),
        example: examples.number(key),
        only_with: Kinds::of(&key.path(), examples),
    });
    other.chain(choices).chain(numbers).collect()
}

/// Kinds of cranes that have a key: circuit and structure, each `None` if it does not matter.
#[derive(Clone, Copy, PartialEq)]
struct Kinds {
    circuit: Option<CircuitChoice>,
    structure: Option<StructureChoice>,
}

impl Kinds {
    fn of(path: &str, examples: &Examples) -> Self {
        let (section, name) = path.split_once('.').unwrap_or((path, ""));
        let circuits = [CircuitChoice::SelfContained, CircuitChoice::ValveControlled];
        let structures = [StructureChoice::Beam, StructureChoice::Links];
        let has = |circuit, structure| {
            let choices = Choices { circuit, structure, ..examples.paper.choices };
            choices.excludes(section, name, LINKS).is_none()
        };
        let of_circuit = circuits.map(|circuit| structures.iter().any(|s| has(circuit, *s)));
        let of_structure = structures.map(|structure| circuits.iter().any(|c| has(*c, structure)));
        Self { circuit: only(circuits, of_circuit), structure: only(structures, of_structure) }
    }

    fn sentence(self) -> Option<String> {
        let circuit = self.circuit.map(|circuit| match circuit {
            CircuitChoice::SelfContained => "a self-contained circuit",
            CircuitChoice::ValveControlled => "a valve-controlled circuit",
        });
        let structure = self.structure.map(|structure| match structure {
            StructureChoice::Beam => "a beam",
            StructureChoice::Links => "a boom of links",
        });
        let kinds: Vec<&str> = circuit.into_iter().chain(structure).collect();
        (!kinds.is_empty()).then(|| format!("Only with {}.", kinds.join(" and ")))
    }
}

/// The kind that has a key, if the other has it not.
fn only<T>([first, second]: [T; 2], has: [bool; 2]) -> Option<T> {
    match has {
        [true, false] => Some(first),
        [false, true] => Some(second),
        _ => None,
    }
}

/// Shipped cranes whose values are examples.
struct Examples {
    paper: Description,
    virtual_crane: Description,
    lift: Description,
}

impl Examples {
    fn read() -> Result<Self, DescriptionError> {
        Ok(Self {
            paper: Description::uia_single_boom()?,
            virtual_crane: Description::uia_virtual()?,
            lift: Description::patu_lift()?,
        })
    }

    fn all(&self) -> [(&Description, &'static str); 3] {
        [(&self.paper, ""), (&self.virtual_crane, " (virtual)"), (&self.lift, " (lift)")]
    }

    /// Value of the first crane whose file states the number, with provenance and source.
    fn number(&self, key: &Key) -> String {
        let stated = self.all().into_iter().find_map(|(crane, mark)| {
            let mut entries = crane.own_entries();
            let (_, value, origin) =
                entries.find(|(its, _, origin)| *its == key && origin.is_stated())?;
            let reasons = [origin.provenance.as_str(), origin.source.as_str()];
            let reasons: Vec<&str> = reasons.into_iter().filter(|text| !text.is_empty()).collect();
            Some(format!("{}{mark}: {}", number(value), reasons.join(", ")))
        });
        stated.unwrap_or_default()
    }

    /// Name of a choice of the paper's crane, or of the lift.
    fn choice(&self, path: &str) -> String {
        let named =
            [(&self.paper, ""), (&self.lift, " (lift)")].into_iter().find_map(|(crane, mark)| {
                let all = crane.own_choices();
                let (_, name) = all.into_iter().find(|(its, _)| *its == path)?;
                Some(format!("`{name}`{mark}"))
            });
        named.unwrap_or_default()
    }
}

/// Number in its shortest form, very small and very large ones with an exponent.
fn number(value: f64) -> String {
    match value != 0.0 && !(1e-3..1e6).contains(&value.abs()) {
        true => format!("{value:e}"),
        false => value.to_string(),
    }
}

/// Text for a cell of a table.
fn in_table(text: &str) -> String {
    text.replace('|', "\\|").replace('<', "\\<").replace('*', "\\*")
}

/// Text in lines of limited length.
fn wrapped(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= LINE => {
                *line += &format!(" {word}");
            }
            _ => lines.push(word.into()),
        }
    }
    lines.join("\n")
}
