//! Interpreter of function blocks after the standard, with `iecst` as the parser. It is independent of the code
//! generator. A unit is translated once, when it is read.

mod program;
mod translation;
mod used;

use iecst::{Pou, VarBlockKind, parse_pou};
use program::{Instruction, Memory, Place, run};
use std::cell::Cell;
use std::collections::HashMap;
use std::rc::Rc;

thread_local! {
    /// Relative error of functions, as on another platform.
    pub static LAST_DIGIT: Cell<f64> = const { Cell::new(0.0) };
}

/// A translated unit. Names are case-insensitive and stored in capitals.
#[derive(Debug, Default)]
struct Unit {
    places: HashMap<String, Place>,
    /// Section in which each variable is declared.
    sections: HashMap<String, VarBlockKind>,
    /// The result variable of a function.
    returned: Option<String>,
    /// Instances of the functions that are called.
    functions: HashMap<String, usize>,
    /// Locations of the numeric outputs, in their order.
    outputs: Vec<usize>,
    instructions: Vec<Instruction>,
    /// Initial memory of an instance.
    initial: Memory,
}

/// Units by name.
#[derive(Clone, Debug, Default)]
pub struct Library(HashMap<String, Rc<Unit>>);

impl Library {
    /// Reads units in any order.
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

    /// Translates a unit after the units that it contains; a unit cannot contain itself.
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

    /// An instance of a unit with the instances inside it; every variable has its declared initial value.
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
    /// Reads a block that contains no others.
    pub fn parse(text: &str) -> Self {
        let library = Library::parse([text]);
        let name = library.0.keys().next().cloned().unwrap_or_default();
        library.instance(&name)
    }

    /// Value of a variable.
    pub fn value(&self, name: &str) -> f64 {
        match self.unit.place(name) {
            Place::Number(k) => self.memory.numbers[*k],
            other => panic!("{name} is {other:?}"),
        }
    }

    /// Sets a variable.
    pub fn set(&mut self, name: &str, value: f64) {
        match self.unit.place(name) {
            Place::Number(k) => self.memory.numbers[*k] = self.memory.held(value),
            other => panic!("{name} is {other:?}"),
        }
    }

    /// Sets a condition.
    pub fn truth(&mut self, name: &str, value: bool) {
        match self.unit.place(name) {
            Place::Truth(k) => self.memory.truths[*k] = value,
            other => panic!("{name} is {other:?}"),
        }
    }

    /// Sets an entry of an array.
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

    /// An inner block.
    pub fn inner(&mut self, name: &str) -> &mut Self {
        match self.unit.place(name) {
            Place::Block(k) => &mut self.memory.blocks[*k],
            other => panic!("{name} is {other:?}"),
        }
    }

    /// All numeric outputs, in their order.
    pub fn shown(&self) -> Vec<f64> {
        self.unit.outputs.iter().map(|k| self.memory.numbers[*k]).collect()
    }

    /// Calls the block.
    pub fn call(&mut self, inputs: &[(&str, f64)]) {
        self.call_with(inputs, &[]);
    }

    /// Calls the block with some conditions; `bReset` and `bPrepare`, if it has that, are false otherwise.
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

    /// Value of an integer.
    pub fn count(&self, name: &str) -> i64 {
        match self.unit.place(name) {
            Place::Integer(k) => self.memory.integers[*k],
            other => panic!("{name} is {other:?}"),
        }
    }

    /// Value of a condition.
    pub fn holds(&self, name: &str) -> bool {
        matches!(self.unit.place(name), Place::Truth(k) if self.memory.truths[*k])
    }

    /// Resets every variable to its declared initial value.
    fn begin(&mut self) {
        self.memory = self.unit.initial.clone();
    }

    /// Runs the unit once with its current inputs.
    pub fn run(&mut self) {
        run(&self.unit.instructions, &mut self.memory);
    }
}
