//! Instructions of a unit, and its memory.

use super::{Instance, LAST_DIGIT};
use std::ops::Range;

/// Type of numbers within the interpreter; the memory determines their precision.
pub const NUMBER: &str = "number";

/// Variables of an instance, constants and intermediate results, by type. An array is a range of the numbers, or a
/// list of its own if it is passed by reference.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    pub numbers: Vec<f64>,
    pub lists: Vec<Vec<f64>>,
    pub integers: Vec<i64>,
    pub truths: Vec<bool>,
    pub blocks: Vec<Instance>,
    /// Whether numbers are `REAL`: each result is rounded to single precision.
    pub is_single: bool,
}

/// Location in the memory.
#[derive(Clone, Debug)]
pub enum Place {
    Number(usize),
    Integer(usize),
    Truth(usize),
    List(Range<usize>),
    /// A number of an array, whose index is an integer of the memory.
    Entry(Range<usize>, usize),
    /// An array that is passed by reference.
    Passed(usize),
    /// A number of such an array, whose index is an integer of the memory.
    PassedEntry(usize, usize),
    Block(usize),
    /// Location in the memory of an inner block.
    Inner(usize, Box<Place>),
}

impl Place {
    /// Type of the value.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Number(_) | Self::Entry(..) | Self::PassedEntry(..) => NUMBER,
            Self::Integer(_) => "DINT",
            Self::Truth(_) => "BOOL",
            Self::List(_) | Self::Passed(_) => "ARRAY",
            Self::Block(_) => "a block",
            Self::Inner(_, place) => place.kind(),
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Value {
    Number(f64),
    Integer(i64),
    Truth(bool),
}

impl Memory {
    /// Rounds a number to the memory's precision. Rounding the double result of a sum, product, quotient or
    /// root to single precision gives the single-precision result. 53 bits are more than 2 x 24 + 2
    /// (Figueroa, When is double rounding innocuous?).
    pub fn held(&self, number: f64) -> f64 {
        if self.is_single { f64::from(number as f32) } else { number }
    }

    /// Passes arrays to a block, or takes them back. An array that is passed twice is empty the second time.
    fn exchange(&mut self, block: usize, passed: &[[usize; 2]]) {
        for [own, inner] in passed {
            std::mem::swap(&mut self.lists[*own], &mut self.blocks[block].memory.lists[*inner]);
        }
    }

    fn value(&self, place: &Place) -> Value {
        match place {
            Place::Number(k) => Value::Number(self.numbers[*k]),
            Place::Integer(k) => Value::Integer(self.integers[*k]),
            Place::Truth(k) => Value::Truth(self.truths[*k]),
            Place::Entry(list, k) => {
                Value::Number(self.numbers[list.clone()][self.integers[*k] as usize])
            }
            Place::PassedEntry(list, k) => {
                Value::Number(self.lists[*list][self.integers[*k] as usize])
            }
            Place::Inner(block, place) => self.blocks[*block].memory.value(place),
            Place::List(_) | Place::Passed(_) | Place::Block(_) => {
                panic!("{place:?} is no single value")
            }
        }
    }

    fn set(&mut self, place: &Place, value: Value) {
        match (place, value) {
            (Place::Number(k), Value::Number(v)) => self.numbers[*k] = self.held(v),
            (Place::Integer(k), Value::Integer(v)) => self.integers[*k] = v,
            (Place::Truth(k), Value::Truth(v)) => self.truths[*k] = v,
            (Place::Entry(list, k), Value::Number(v)) => {
                let held = self.held(v);
                self.numbers[list.clone()][self.integers[*k] as usize] = held;
            }
            (Place::PassedEntry(list, k), Value::Number(v)) => {
                let held = self.held(v);
                self.lists[*list][self.integers[*k] as usize] = held;
            }
            (Place::Inner(block, place), value) => self.blocks[*block].memory.set(place, value),
            other => panic!("{other:?} are of different types"),
        }
    }
}

/// Computes a value from operands at given locations.
#[derive(Debug)]
pub enum Operation {
    Number(fn(f64, f64) -> f64, [usize; 2]),
    Integer(fn(i64, i64) -> i64, [usize; 2]),
    Truth(fn(bool, bool) -> bool, [usize; 2]),
    Compare(fn(f64, f64) -> bool, [usize; 2]),
    CompareIntegers(fn(i64, i64) -> bool, [usize; 2]),
    /// A function that another platform may round differently.
    Rounded(fn(f64) -> f64, usize),
    /// Lower limit, value and upper limit.
    Limit([usize; 3]),
    LimitInteger([usize; 3]),
    /// A condition, the value where it is false, and the value where it is true.
    Select(usize, [usize; 2]),
    ToNumber(usize),
    /// Halves are rounded to the even number.
    ToInteger(usize),
}

impl Operation {
    /// Type of the result.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Number(..) | Self::Rounded(..) | Self::Limit(_) => NUMBER,
            Self::Select(..) | Self::ToNumber(_) => NUMBER,
            Self::Integer(..) | Self::LimitInteger(_) | Self::ToInteger(_) => "DINT",
            Self::Truth(..) | Self::Compare(..) | Self::CompareIntegers(..) => "BOOL",
        }
    }

    /// Executes the operation and stores its result.
    fn run(&self, to: usize, memory: &mut Memory) {
        let Memory { numbers, integers, truths, .. } = memory;
        let number = match self {
            Self::Number(f, [a, b]) => f(numbers[*a], numbers[*b]),
            Self::Rounded(f, a) => f(numbers[*a]) * (1.0 + LAST_DIGIT.get()),
            Self::Limit([low, a, high]) => numbers[*a].max(numbers[*low]).min(numbers[*high]),
            Self::Select(k, values) => numbers[values[usize::from(truths[*k])]],
            Self::ToNumber(a) => integers[*a] as f64,
            Self::Integer(f, [a, b]) => return integers[to] = f(integers[*a], integers[*b]),
            Self::Truth(f, [a, b]) => return truths[to] = f(truths[*a], truths[*b]),
            Self::Compare(f, [a, b]) => return truths[to] = f(numbers[*a], numbers[*b]),
            Self::CompareIntegers(f, [a, b]) => {
                return truths[to] = f(integers[*a], integers[*b]);
            }
            Self::LimitInteger([low, a, high]) => {
                return integers[to] = integers[*a].max(integers[*low]).min(integers[*high]);
            }
            Self::ToInteger(a) => return integers[to] = numbers[*a].round_ties_even() as i64,
        };
        memory.numbers[to] = memory.held(number);
    }
}

#[derive(Debug)]
pub enum Instruction {
    /// Location of the result, of the result's type, and the operation.
    Result(usize, Operation),
    /// Destination, and source of the same type.
    Copy(Place, Place),
    If(usize, Vec<Instruction>),
    /// Loop variable, its first and last value, and the body.
    For(usize, [usize; 2], Vec<Instruction>),
    /// Call of an inner block, with its arrays by reference: index in the caller and in the block.
    Call(usize, Vec<[usize; 2]>),
    /// Resets the variables of a function to their declared values.
    Begin(usize),
}

pub fn run(instructions: &[Instruction], memory: &mut Memory) {
    for instruction in instructions {
        match instruction {
            Instruction::Result(to, operation) => operation.run(*to, memory),
            Instruction::Copy(to, from) => memory.set(to, memory.value(from)),
            Instruction::If(condition, body) => {
                if memory.truths[*condition] {
                    run(body, memory);
                }
            }
            Instruction::For(variable, [first, last], body) => {
                for k in memory.integers[*first]..=memory.integers[*last] {
                    memory.integers[*variable] = k;
                    run(body, memory);
                }
            }
            Instruction::Call(block, passed) => {
                memory.exchange(*block, passed);
                memory.blocks[*block].run();
                memory.exchange(*block, passed);
            }
            Instruction::Begin(function) => memory.blocks[*function].begin(),
        }
    }
}
