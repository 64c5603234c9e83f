//! The function of a loop body: parameters, statements and results.

use super::{Shared, Writing};
use crate::graph::{Node, Op};
use crate::name::Names;
use crate::repeated_part::RepeatedPart;
use crate::statement::{FEWEST, Function, Kind, Parameter, ParameterKind, Text, entry};
use std::collections::HashMap;

/// Largest number of outside values that are passed one by one: the number of registers for arguments on x86-64 and
/// Arm. More are passed as an array, which is filled before the loop.
pub(crate) const MOST_ONE_BY_ONE: usize = 8;

/// A function, and the arguments of each loop.
#[derive(Clone)]
pub(super) struct Defined {
    pub(super) function: usize,
    pub(super) arguments: Vec<Argument>,
}

/// An argument of a loop's function.
#[derive(Clone, Debug)]
pub(super) enum Argument {
    /// Index of the row.
    Row,
    /// The row's entry in the table with this index among those that the loop reads.
    Entry(u32),
    /// A loop-carried value, by its index.
    Carried(u32),
    /// An outside value of the body, by its index.
    Outside(usize),
    /// Several outside values as an array.
    Array(Vec<usize>),
    /// An existing array.
    Whole(String),
}

impl Writing<'_, '_, '_> {
    /// Writes the function of a loop body with the outside values `given`.
    pub(super) fn define(&mut self, part: usize, given: &[Node]) -> Defined {
        let graph = self.source.graph;
        let of = self.shared.parts.parts[part].clone();
        let mut names = self.dialect.names();
        let mut head = Head::default();
        self.own(of.loop_number, &mut names, &mut head);
        self.take_numbers(&of, given, &mut names, &mut head);
        self.take_tables_and_conditions(&of.taken, &mut names, &mut head);
        let Head { parameters, arguments, legend, texts, tables, arrays } = head;
        let mut inner = Writing {
            source: self.source,
            dialect: self.dialect,
            names: &mut names,
            shared: &mut *self.shared,
            scope: Some(of.loop_number),
            texts,
            tables,
            arrays,
            loops: HashMap::new(),
            said: Vec::new(),
        };
        inner.write_all();
        let results = inner.results(of.loop_number);
        let body = inner.said;
        let origin = graph.repetition(of.loop_number).origin.clone();
        let functions = &*self.shared.functions;
        let number = 1 + functions.iter().filter(|other| other.origin == origin).count();
        let mut rows = of.rows;
        rows.sort_unstable();
        rows.dedup();
        let function = Function {
            origins: vec![origin.clone()],
            origin,
            number,
            rows,
            parameters,
            legend,
            body,
            results,
        };
        let defined = Defined { function: self.shared.place(function), arguments };
        self.shared.defined.insert(part, defined.clone());
        defined
    }

    /// Parameters from the loop's row: index, entries, loop-carried values.
    fn own(&self, number: u32, names: &mut Names, head: &mut Head) {
        for node in self.source.order {
            let (name, taken, argument) = match self.source.graph.op(*node) {
                Op::Row(of) if of == number => {
                    let name = names.free("row");
                    head.texts.insert(*node, self.dialect.row(&name));
                    head.take(name, ParameterKind::Row, Argument::Row);
                    continue;
                }
                Op::Read(of, k) if of == number => {
                    (names.numbered("x"), ParameterKind::One(Kind::Number), Argument::Entry(k))
                }
                Op::Carry(of, k) if of == number => {
                    (names.numbered("a"), ParameterKind::One(Kind::Number), Argument::Carried(k))
                }
                _ => continue,
            };
            head.texts.insert(*node, Text::whole(name.clone()));
            head.take(name, taken, argument);
        }
    }

    /// Parameters for numbers from outside: as existing arrays, as one array, or one by one.
    fn take_numbers(&self, of: &RepeatedPart, given: &[Node], names: &mut Names, head: &mut Head) {
        let graph = self.source.graph;
        let is_number =
            |node: Node| !matches!(graph.op(node), Op::Table(_)) && !graph.op(node).is_condition();
        let taken = of.taken.iter().enumerate();
        let mut numbers: Vec<usize> =
            taken.filter(|(_, node)| is_number(**node)).map(|(place, _)| place).collect();
        // with a single loop, several entries of one array are passed as that array; other loops may use other arrays
        if of.rows.len() == 1 {
            numbers = self.arrays_of(&of.taken, given, numbers, names, head);
        }
        if numbers.len() > MOST_ONE_BY_ONE {
            let name = names.free("b");
            for (k, place) in numbers.iter().enumerate() {
                let text = format!("{name}[{k}]");
                if let Some(known) = self.known(of.taken[*place]) {
                    head.legend.push(format!("{text}: {known}"));
                }
                head.texts.insert(of.taken[*place], Text::whole(text));
            }
            head.arrays.insert(name.clone(), numbers.len());
            head.take(name, ParameterKind::Table(numbers.len()), Argument::Array(numbers));
        } else {
            for place in numbers {
                let node = of.taken[place];
                let name = match self.known(node).filter(|_| of.rows.len() == 1) {
                    Some(known) => names.free(&known),
                    None => names.numbered("b"),
                };
                head.texts.insert(node, Text::whole(name.clone()));
                head.take(name, ParameterKind::One(Kind::Number), Argument::Outside(place));
            }
        }
    }

    /// Parameters for tables and conditions from outside.
    fn take_tables_and_conditions(&self, taken: &[Node], names: &mut Names, head: &mut Head) {
        let graph = self.source.graph;
        for (place, node) in taken.iter().enumerate() {
            match graph.op(*node) {
                Op::Table(number) => {
                    let (name, length) = (names.numbered("r"), graph.table(number).len());
                    head.tables.insert(*node, (name.clone(), 0));
                    head.arrays.insert(name.clone(), length);
                    head.take(name, ParameterKind::Table(length), Argument::Outside(place));
                }
                op if op.is_condition() => {
                    let name = names.numbered("is");
                    head.texts.insert(*node, Text::whole(name.clone()));
                    head.take(name, ParameterKind::One(Kind::Condition), Argument::Outside(place));
                }
                _ => {}
            }
        }
    }

    /// Passes arrays of which several entries are used as arrays; returns the remaining values.
    fn arrays_of(
        &self,
        taken: &[Node],
        given: &[Node],
        numbers: Vec<usize>,
        names: &mut Names,
        head: &mut Head,
    ) -> Vec<usize> {
        let texts: Vec<String> = given.iter().map(|node| self.text(*node).text).collect();
        let array = |place: usize| {
            let found = entry(&texts[place]).filter(|(array, _)| self.arrays.contains_key(*array));
            found.map(|(array, k)| (array.to_string(), k))
        };
        let mut known: Vec<String> = Vec::new();
        for (name, _) in numbers.iter().filter_map(|place| array(*place)) {
            if !known.contains(&name) {
                known.push(name);
            }
        }
        let mut left = numbers;
        for name in known {
            let is_in = |place: &usize| array(*place).is_some_and(|(of, _)| of == name);
            let (inside, others): (Vec<usize>, Vec<usize>) = left.iter().partition(|p| is_in(p));
            if inside.len() < FEWEST {
                continue;
            }
            let own = match plain(&name) {
                Some(own) if self.source.arrays.contains_key(&name) => names.free(own),
                _ => names.numbered("r"),
            };
            for place in inside {
                let Some((_, k)) = array(place) else { continue };
                head.texts.insert(taken[place], Text::whole(format!("{own}[{k}]")));
            }
            let length = self.arrays[&name];
            head.arrays.insert(own.clone(), length);
            head.take(own, ParameterKind::Table(length), Argument::Whole(name));
            left = others;
        }
        left
    }

    /// The name of a node that is independent of the function.
    fn known(&self, node: Node) -> Option<String> {
        if let Some((name, _)) = self.source.labels.get(&node) {
            return Some(name.clone());
        }
        let text = self.source.given.get(&node)?;
        plain(&text.text).map(str::to_string)
    }

    /// Results of a loop's body: loop-carried values, and the row's entries.
    fn results(&mut self, number: u32) -> Vec<(String, String)> {
        let of = self.source.graph.repetition(number);
        let needed = &self.shared.parts.needed;
        let next = needed.carried(number).into_iter().map(|k| ("n", of.next[k as usize]));
        let made = needed.made(number).into_iter().map(|k| ("m", of.made[k as usize]));
        let all: Vec<(&str, Node)> = next.chain(made).collect();
        all.into_iter()
            .map(|(name, node)| (self.names.numbered(name), self.text(node).text))
            .collect()
    }
}

impl Shared<'_> {
    /// Place of a function among those of the block; equal ones share a place.
    fn place(&mut self, function: Function) -> usize {
        let known = self.functions.iter().position(|other| other.is_same_function(&function));
        match known {
            Some(place) => {
                self.functions[place].shared_with(&function);
                place
            }
            None => {
                self.functions.push(function);
                self.functions.len() - 1
            }
        }
    }
}

/// A name without the object of which it is a member; `None` for other expressions.
fn plain(text: &str) -> Option<&str> {
    let name = text.rsplit("->").next()?;
    let is_name = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    (is_name && name.starts_with(|c: char| c.is_ascii_alphabetic())).then_some(name)
}

/// Parameter list under construction.
#[derive(Default)]
struct Head {
    parameters: Vec<Parameter>,
    arguments: Vec<Argument>,
    legend: Vec<String>,
    texts: HashMap<Node, Text>,
    tables: HashMap<Node, (String, usize)>,
    arrays: HashMap<String, usize>,
}

impl Head {
    fn take(&mut self, name: String, taken: ParameterKind, argument: Argument) {
        self.parameters.push(Parameter { name, taken });
        self.arguments.push(argument);
    }
}
