//! Executes function blocks as the standard says: `iecst` reads them, this does what stands there. It knows nothing of how they
//! were made. A unit is translated once, when it is read.

mod program;
mod translation;
mod used;

use iecst::{Pou, VarBlockKind, parse_pou};
use program::{Instruction, Memory, Place, run};
use std::cell::Cell;
use std::collections::HashMap;
use std::rc::Rc;

thread_local! {
    /// By what share functions are off, as those of another platform may be.
    pub static LAST_DIGIT: Cell<f64> = const { Cell::new(0.0) };
}

/// A unit, translated. Names do not depend on case: they are kept in capitals.
#[derive(Debug, Default)]
struct Unit {
    places: HashMap<String, Place>,
    /// Where each variable is declared.
    sections: HashMap<String, VarBlockKind>,
    /// The variable that a function returns.
    returned: Option<String>,
    /// Instances of the functions that are called.
    functions: HashMap<String, usize>,
    /// Places of the outputs that are numbers, in their order.
    outputs: Vec<usize>,
    instructions: Vec<Instruction>,
    /// Memory that an instance begins with.
    initial: Memory,
}

/// Units by name.
#[derive(Clone, Debug, Default)]
pub struct Library(HashMap<String, Rc<Unit>>);

impl Library {
    /// Reads units, in whatever order.
    pub fn parse<'a>(texts: impl IntoIterator<Item = &'a str>) -> Self {
        let mut read = HashMap::new();
        for text in texts {
            // the parser knows no literals with a type
            let pou = parse_pou(&text.replace("LREAL#", "").replace("REAL#", ""))
                .unwrap_or_else(|e| panic!("{e:?} in\n{text}"));
            let name = pou.name.to_ascii_uppercase();
            assert!(read.insert(name, pou).is_none(), "a unit is read twice:\n{text}");
        }
        let mut library = Self::default();
        while let Some(name) = read.keys().next().cloned() {
            library.translate(&name, &mut read);
        }
        library
    }

    /// Translates a unit that was read, those within it first; a unit cannot hold itself.
    fn translate(&mut self, name: &str, read: &mut HashMap<String, Pou>) {
        let pou = read.remove(name).unwrap_or_else(|| panic!("no unit {name}"));
        let unit = Unit::translate(&pou, &mut |inner| {
            if read.contains_key(inner) {
                self.translate(inner, read);
            }
            self.0.contains_key(inner).then(|| self.instance(inner))
        });
        self.0.insert(name.to_string(), Rc::new(unit));
    }

    /// An instance of a unit, those within it included; every variable begins as it is declared.
    pub fn instance(&self, name: &str) -> Instance {
        let unit =
            self.0.get(&name.to_ascii_uppercase()).unwrap_or_else(|| panic!("no unit {name}"));
        Instance { unit: Rc::clone(unit), memory: unit.initial.clone() }
    }
}

/// A function block with its memory.
#[derive(Clone, Debug)]
pub struct Instance {
    unit: Rc<Unit>,
    memory: Memory,
}

impl Instance {
    /// Reads a block that has no others in it.
    pub fn parse(text: &str) -> Self {
        let library = Library::parse([text]);
        let name = library.0.keys().next().cloned().unwrap_or_default();
        library.instance(&name)
    }

    /// A variable.
    pub fn value(&self, name: &str) -> f64 {
        match self.unit.place(name) {
            Place::Number(k) => self.memory.numbers[*k],
            other => panic!("{name} is {other:?}"),
        }
    }

    /// Changes a variable.
    pub fn set(&mut self, name: &str, value: f64) {
        match self.unit.place(name) {
            Place::Number(k) => self.memory.numbers[*k] = self.memory.held(value),
            other => panic!("{name} is {other:?}"),
        }
    }

    /// Changes a condition.
    pub fn truth(&mut self, name: &str, value: bool) {
        match self.unit.place(name) {
            Place::Truth(k) => self.memory.truths[*k] = value,
            other => panic!("{name} is {other:?}"),
        }
    }

    /// Changes a number of an array.
    pub fn set_in_list(&mut self, name: &str, place: usize, value: f64) {
        match self.unit.place(name) {
            Place::List(list) => {
                let held = self.memory.held(value);
                self.memory.numbers[list.clone()][place] = held;
            }
            Place::Passed(list) => self.memory.lists[*list][place] = self.memory.held(value),
            other => panic!("{name} is {other:?}"),
        }
    }

    /// A block within this one.
    pub fn inner(&mut self, name: &str) -> &mut Self {
        match self.unit.place(name) {
            Place::Block(k) => &mut self.memory.blocks[*k],
            other => panic!("{name} is {other:?}"),
        }
    }

    /// All outputs that are numbers, in their order.
    pub fn shown(&self) -> Vec<f64> {
        self.unit.outputs.iter().map(|k| self.memory.numbers[*k]).collect()
    }

    /// Calls the block.
    pub fn call(&mut self, inputs: &[(&str, f64)]) {
        self.call_with(inputs, &[]);
    }

    /// Calls the block with some conditions; `bReset` and, where it has it, `bPrepare` are off otherwise.
    pub fn call_with(&mut self, inputs: &[(&str, f64)], conditions: &[(&str, bool)]) {
        for own in ["bReset", "bPrepare"] {
            if self.unit.has(own) {
                self.truth(own, false);
            }
        }
        for (name, value) in inputs {
            self.set(name, *value);
        }
        for (name, value) in conditions {
            self.truth(name, *value);
        }
        self.run();
    }

    /// A whole number.
    pub fn count(&self, name: &str) -> i64 {
        match self.unit.place(name) {
            Place::Integer(k) => self.memory.integers[*k],
            other => panic!("{name} is {other:?}"),
        }
    }

    /// A condition.
    pub fn holds(&self, name: &str) -> bool {
        matches!(self.unit.place(name), Place::Truth(k) if self.memory.truths[*k])
    }

    /// Every variable as it is declared.
    fn begin(&mut self) {
        self.memory = self.unit.initial.clone();
    }

    /// Runs the unit once with the inputs that it has.
    pub fn run(&mut self) {
        run(&self.unit.instructions, &mut self.memory);
    }
}
