//! Translation of parsed units to instructions: names become memory locations, and types are checked. Undeclared or
//! unknown names and wrong types are refused with the name.

use super::program::Place::{self, Integer, Number, Truth};
use super::program::{Instruction, NUMBER, Operation, run};
use super::used::Used;
use super::{Instance, Unit};
use iecst::{
    BinaryOp, Expr, ExprKind, FunctionArg, Pou, PouKind, Stmt, StmtKind, TypeKind, UnaryOp,
    VarBlockKind, VarDecl,
};

/// Creates an instance of another unit, if there is one of that name.
type Instances<'a> = &'a mut dyn FnMut(&str) -> Option<Instance>;

impl Unit {
    /// Translates a unit.
    pub fn translate(pou: &Pou, instance: Instances<'_>) -> Self {
        let mut unit = Self::default();
        unit.initial.is_single = is_single(pou);
        let mut used = Used::default();
        used.by(&pou.body);
        if pou.kind == PouKind::Function {
            let result = pou.return_type.as_ref().map(|result| &result.kind);
            let Some(TypeKind::Simple(kind)) = result else {
                panic!("{} returns nothing", pou.name)
            };
            let place = unit.allocate(&kind.to_ascii_uppercase());
            let name = pou.name.to_ascii_uppercase();
            unit.places.insert(name.clone(), place.unwrap_or_else(|| panic!("{kind}")));
            unit.returned = Some(name);
        }
        for block in &pou.var_blocks {
            for variable in &block.vars {
                let name = variable.name.to_ascii_uppercase();
                let is_passed = used.arguments.contains(&name);
                let place = unit.declare(block.kind, variable, is_passed, instance);
                let has_memory = matches!(place, Place::Block(_));
                assert!(pou.kind != PouKind::Function || !has_memory, "{name} has memory");
                unit.sections.insert(name, block.kind);
                if let (VarBlockKind::VarOutput, Number(k)) = (block.kind, &place) {
                    unit.outputs.push(*k);
                }
                let before = unit.places.insert(variable.name.to_ascii_uppercase(), place);
                assert!(before.is_none(), "{} is declared twice", variable.name);
            }
        }
        for name in used.functions {
            if let Some(function) = instance(&name) {
                let place = push(&mut unit.initial.blocks, function);
                unit.functions.insert(name, place);
            }
        }
        unit.instructions = unit.body(&pou.body);
        unit
    }

    /// Location of a new variable; sets its initial value.
    fn declare(
        &mut self,
        block: VarBlockKind,
        variable: &VarDecl,
        is_passed: bool,
        instance: Instances<'_>,
    ) -> Place {
        let is_reference = block == VarBlockKind::VarInOut;
        match (&variable.var_type.kind, &variable.initial) {
            (TypeKind::Simple(kind), initial) => {
                assert!(!is_reference, "{variable:?}: only arrays are passed by reference");
                let kind = kind.to_ascii_uppercase();
                match (self.allocate(&kind), initial) {
                    (Some(place), None) => place,
                    (Some(place), Some(value)) => {
                        let value = self.expression(value);
                        self.copy(&variable.name, place.clone(), value);
                        self.initialise();
                        place
                    }
                    (None, None) => {
                        let block = instance(&kind).unwrap_or_else(|| panic!("no unit {kind}"));
                        assert!(block.unit.returned.is_none(), "{kind} is a function");
                        Place::Block(push(&mut self.initial.blocks, block))
                    }
                    (None, Some(_)) => panic!("{variable:?}"),
                }
            }
            (TypeKind::Array { ranges, element }, None) => {
                let (TypeKind::Simple(kind), [range]) = (&element.kind, &ranges[..]) else {
                    panic!("{variable:?}")
                };
                let limits = [&range.low, &range.high].map(|e| self.index(e));
                self.initialise();
                let [first, last] = limits.map(|k| self.initial.integers[k]);
                let is_known = kind.eq_ignore_ascii_case(self.number()) && first == 0 && last >= 0;
                assert!(is_known, "{variable:?}");
                // a local entry has to be set before it is read, although a PLC begins with zeros
                let value = if block == VarBlockKind::VarInput { 0.0 } else { f64::NAN };
                let length = last as usize + 1;
                if is_reference || is_passed {
                    return Place::Passed(push(&mut self.initial.lists, vec![value; length]));
                }
                let begin = self.initial.numbers.len();
                self.initial.numbers.resize(begin + length, value);
                Place::List(begin..begin + length)
            }
            _ => panic!("{variable:?}"),
        }
    }

    /// A new location, if the type is elementary.
    fn allocate(&mut self, kind: &str) -> Option<Place> {
        Some(match kind {
            kind if kind == NUMBER || kind == self.number() => {
                Number(push(&mut self.initial.numbers, 0.0))
            }
            "DINT" => Integer(push(&mut self.initial.integers, 0)),
            "BOOL" => Truth(push(&mut self.initial.truths, false)),
            _ => return None,
        })
    }

    /// Type of the unit's numbers in the standard.
    fn number(&self) -> &'static str {
        if self.initial.is_single { "REAL" } else { "LREAL" }
    }

    /// Executes the instructions so far on the initial memory: initial values and array limits.
    fn initialise(&mut self) {
        run(&std::mem::take(&mut self.instructions), &mut self.initial);
    }

    /// Whether a variable of this name is declared.
    pub fn has(&self, name: &str) -> bool {
        self.places.contains_key(&name.to_ascii_uppercase())
    }

    pub fn place(&self, name: &str) -> &Place {
        let place = self.places.get(&name.to_ascii_uppercase());
        place.unwrap_or_else(|| panic!("{name} is not declared"))
    }

    /// A variable of an inner block.
    fn inner(&self, name: &str, variable: &str) -> Place {
        self.within(self.block(name), variable)
    }

    fn within(&self, block: usize, variable: &str) -> Place {
        Place::Inner(block, Box::new(self.initial.blocks[block].unit.place(variable).clone()))
    }

    /// The assignments of a call; returns the call instruction.
    fn given(&mut self, name: &str, block: usize, given: &[(&String, &Expr)]) -> Instruction {
        let mut passed = Vec::new();
        let mut inputs = Vec::new();
        for (input, value) in given {
            let unit = std::rc::Rc::clone(&self.initial.blocks[block].unit);
            let place = unit.place(input).clone();
            match (unit.sections[&input.to_ascii_uppercase()], place) {
                (VarBlockKind::VarInOut, Place::Passed(list)) => {
                    passed.push([self.array(value, unit.initial.lists[list].len()), list]);
                }
                (VarBlockKind::VarInput, _) => inputs.push((input, self.expression(value))),
                _ => panic!("{input} of {name} is not given"),
            }
        }
        let of_unit = &self.initial.blocks[block].unit;
        let is_passed = |kind: &&VarBlockKind| **kind == VarBlockKind::VarInOut;
        let references = of_unit.sections.values().filter(is_passed).count();
        assert_eq!(passed.len(), references, "{name}: each VAR_IN_OUT is given in a call");
        // all values are evaluated before the first assignment
        for (input, value) in inputs {
            self.copy(input, self.within(block, input), value);
        }
        Instruction::Call(block, passed)
    }

    /// An array of this length that can be passed by reference.
    fn array(&self, value: &Expr, length: usize) -> usize {
        let ExprKind::Ident(name) = &value.kind else { panic!("{value:?} is no variable") };
        let Place::Passed(list) = *self.place(name) else { panic!("{name} is no array") };
        assert_eq!(self.initial.lists[list].len(), length, "types of {name} and of what it is");
        let is_input = self.sections[&name.to_ascii_uppercase()] == VarBlockKind::VarInput;
        assert!(!is_input, "{name} is an input, which nobody may change");
        list
    }

    fn block(&self, name: &str) -> usize {
        match self.place(name) {
            Place::Block(k) => *k,
            other => panic!("{name} is {}", other.kind()),
        }
    }

    /// An entry of an array; with a literal index it is an ordinary number.
    fn entry(&mut self, array: &Expr, indices: &[Expr]) -> Place {
        let (ExprKind::Ident(name), [index]) = (&array.kind, indices) else {
            panic!("{array:?}, {indices:?}")
        };
        let list = match self.place(name).clone() {
            Place::List(list) => list,
            Place::Passed(list) => {
                if let ExprKind::IntLiteral(k) = index.kind {
                    let length = self.initial.lists[list].len() as i64;
                    assert!((0..length).contains(&k), "{name} has no entry {k}");
                }
                return Place::PassedEntry(list, self.index(index));
            }
            _ => panic!("{name} is no array"),
        };
        match index.kind {
            ExprKind::IntLiteral(k) => match list.clone().nth(k as usize) {
                Some(place) => Number(place),
                None => panic!("{name} has no entry {k}"),
            },
            _ => Place::Entry(list, self.index(index)),
        }
    }

    /// Assigns a value to a variable, which must have the same type.
    fn copy(&mut self, name: &str, to: Place, from: Place) {
        assert_eq!(to.kind(), from.kind(), "types of {name} and of its value");
        self.instructions.push(Instruction::Copy(to, from));
    }

    /// Instructions of a list of statements, without those before.
    fn body(&mut self, statements: &[Stmt]) -> Vec<Instruction> {
        let before = std::mem::take(&mut self.instructions);
        statements.iter().for_each(|s| self.statement(s));
        std::mem::replace(&mut self.instructions, before)
    }

    fn statement(&mut self, statement: &Stmt) {
        match &statement.kind {
            StmtKind::Assignment { target, value } => {
                let value = self.expression(value);
                match &target.kind {
                    ExprKind::Ident(name) => self.copy(name, self.place(name).clone(), value),
                    ExprKind::ArrayIndex { array, indices } => {
                        let entry = self.entry(array, indices);
                        self.copy(&format!("{array:?}"), entry, value);
                    }
                    other => panic!("{other:?}"),
                }
            }
            StmtKind::For { var, from, to, by: None, body } => {
                let Integer(k) = *self.place(var) else { panic!("{var} does not count") };
                let limits = [from, to].map(|e| self.index(e));
                let body = self.body(body);
                self.instructions.push(Instruction::For(k, limits, body));
            }
            StmtKind::If { condition, then_body, elsif_branches, else_body } => {
                assert!(elsif_branches.is_empty() && else_body.is_none(), "{condition:?}");
                let Truth(k) = self.expression(condition) else { panic!("{condition:?}") };
                let body = self.body(then_body);
                self.instructions.push(Instruction::If(k, body));
            }
            StmtKind::Call { name, args } => {
                let block = self.block(name);
                let given = args.iter().map(|a| match (&a.name, &a.value) {
                    (Some(input), Some(value)) => (input, value),
                    _ => panic!("{name}: {a:?}"),
                });
                let call = self.given(name, block, &given.collect::<Vec<_>>());
                self.instructions.push(call);
            }
            StmtKind::Empty => {}
            other => panic!("{other:?}"),
        }
    }

    /// Location of an integer.
    fn index(&mut self, e: &Expr) -> usize {
        match self.expression(e) {
            Integer(k) => k,
            other => panic!("a whole number is expected and not {}: {e:?}", other.kind()),
        }
    }

    /// Adds the instructions of an expression; returns the location of its value.
    fn expression(&mut self, e: &Expr) -> Place {
        let place = match &e.kind {
            ExprKind::RealLiteral(v) => {
                let held = self.initial.held(*v);
                Number(push(&mut self.initial.numbers, held))
            }
            ExprKind::IntLiteral(v) => Integer(push(&mut self.initial.integers, *v)),
            ExprKind::BoolLiteral(v) => Truth(push(&mut self.initial.truths, *v)),
            ExprKind::Ident(name) => self.place(name).clone(),
            ExprKind::MemberAccess { expr, member } => {
                let ExprKind::Ident(name) = &expr.kind else { panic!("{expr:?}") };
                self.inner(name, member)
            }
            ExprKind::ArrayIndex { array, indices } => self.entry(array, indices),
            ExprKind::Paren(inner) => self.expression(inner),
            ExprKind::UnaryOp { op, expr } => {
                let operation = match (op, self.expression(expr)) {
                    (UnaryOp::Neg, Number(a)) => Operation::Number(|a, _| -a, [a, a]),
                    (UnaryOp::Not, Truth(a)) => Operation::Truth(|a, _| !a, [a, a]),
                    (_, other) => panic!("{op:?} of {}: {e:?}", other.kind()),
                };
                self.result(operation)
            }
            ExprKind::BinaryOp { left, op, right } => {
                let operands = [left, right].map(|e| self.expression(e));
                self.result(operation(*op, operands))
            }
            ExprKind::FunctionCall { name, args }
                if self.functions.contains_key(&name.to_ascii_uppercase()) =>
            {
                self.called(&name.to_ascii_uppercase(), args)
            }
            ExprKind::FunctionCall { name, args } => {
                let arguments = args.iter().map(|a| match (&a.name, &a.value) {
                    (None, Some(value)) => self.expression(value),
                    _ => panic!("{name}: {a:?}"),
                });
                let arguments: Vec<Place> = arguments.collect();
                let number = self.number();
                self.result(function(&name.to_ascii_uppercase(), number, &arguments))
            }
            other => panic!("{other:?}"),
        };
        match place {
            Number(_) | Integer(_) | Truth(_) => place,
            elsewhere => {
                let here = self.allocate(elsewhere.kind());
                let here = here.unwrap_or_else(|| panic!("{} as a value: {e:?}", elsewhere.kind()));
                self.instructions.push(Instruction::Copy(here.clone(), elsewhere));
                here
            }
        }
    }

    /// Calls a function; returns the location of its result.
    fn called(&mut self, name: &str, args: &[FunctionArg]) -> Place {
        let block = self.functions[name];
        let given = args.iter().map(|a| match (&a.name, &a.value) {
            (Some(input), Some(value)) => (input, value),
            _ => panic!("{name}: {a:?}"),
        });
        let given: Vec<(&String, &Expr)> = given.collect();
        let unit = &self.initial.blocks[block].unit;
        let is_input = |kind: &&VarBlockKind| **kind == VarBlockKind::VarInput;
        let inputs = unit.sections.values().filter(is_input).count();
        assert_eq!(given.len(), inputs, "{name}: each input is given in a call");
        let returned = unit.returned.clone().unwrap_or_else(|| panic!("{name} is no function"));
        self.instructions.push(Instruction::Begin(block));
        let call = self.given(name, block, &given);
        self.instructions.push(call);
        self.within(block, &returned)
    }

    /// Adds an operation; returns the location of its result.
    fn result(&mut self, operation: Operation) -> Place {
        let place = self.allocate(operation.kind()).unwrap();
        let (Number(to) | Integer(to) | Truth(to)) = place else { panic!("{place:?}") };
        self.instructions.push(Instruction::Result(to, operation));
        place
    }
}

/// Whether a unit's numbers are in single precision; mixed precision is refused.
fn is_single(pou: &Pou) -> bool {
    let kinds =
        pou.var_blocks.iter().flat_map(|block| &block.vars).map(|v| match &v.var_type.kind {
            TypeKind::Array { element, .. } => &element.kind,
            kind => kind,
        });
    let is = |kind: &TypeKind, name: &str| matches!(kind, TypeKind::Simple(k) if k.eq_ignore_ascii_case(name));
    kinds.into_iter().any(|kind| is(kind, "REAL"))
}

fn operation(op: BinaryOp, operands: [Place; 2]) -> Operation {
    match (op, operands) {
        (BinaryOp::Add, [Number(a), Number(b)]) => Operation::Number(|a, b| a + b, [a, b]),
        (BinaryOp::Sub, [Number(a), Number(b)]) => Operation::Number(|a, b| a - b, [a, b]),
        (BinaryOp::Mul, [Number(a), Number(b)]) => Operation::Number(|a, b| a * b, [a, b]),
        (BinaryOp::Div, [Number(a), Number(b)]) => Operation::Number(|a, b| a / b, [a, b]),
        (BinaryOp::Lt, [Number(a), Number(b)]) => Operation::Compare(|a, b| a < b, [a, b]),
        (BinaryOp::Gt, [Number(a), Number(b)]) => Operation::Compare(|a, b| a > b, [a, b]),
        (BinaryOp::Lt, [Integer(a), Integer(b)]) => {
            Operation::CompareIntegers(|a, b| a < b, [a, b])
        }
        (BinaryOp::Eq, [Integer(a), Integer(b)]) => {
            Operation::CompareIntegers(|a, b| a == b, [a, b])
        }
        (BinaryOp::Add, [Integer(a), Integer(b)]) => Operation::Integer(|a, b| a + b, [a, b]),
        (BinaryOp::Mod, [Integer(a), Integer(b)]) => Operation::Integer(|a, b| a % b, [a, b]),
        (BinaryOp::And, [Truth(a), Truth(b)]) => Operation::Truth(|a, b| a & b, [a, b]),
        (BinaryOp::Or, [Truth(a), Truth(b)]) => Operation::Truth(|a, b| a | b, [a, b]),
        (op, [a, b]) => panic!("{op:?} of {} and {}", a.kind(), b.kind()),
    }
}

fn function(name: &str, number: &str, arguments: &[Place]) -> Operation {
    match (name, arguments) {
        ("SQRT", &[Number(a)]) => Operation::Rounded(f64::sqrt, a),
        ("EXP", &[Number(a)]) => Operation::Rounded(f64::exp, a),
        ("LN", &[Number(a)]) => Operation::Rounded(f64::ln, a),
        ("SIN", &[Number(a)]) => Operation::Rounded(f64::sin, a),
        ("COS", &[Number(a)]) => Operation::Rounded(f64::cos, a),
        ("ABS", &[Number(a)]) => Operation::Number(|a, _| a.abs(), [a, a]),
        ("LIMIT", &[Number(low), Number(a), Number(high)]) => Operation::Limit([low, a, high]),
        ("LIMIT", &[Integer(low), Integer(a), Integer(high)]) => {
            Operation::LimitInteger([low, a, high])
        }
        ("SEL", &[Truth(condition), Number(no), Number(yes)]) => {
            Operation::Select(condition, [no, yes])
        }
        (name, &[Integer(a)]) if name == format!("DINT_TO_{number}") => Operation::ToNumber(a),
        (name, &[Number(a)]) if name == format!("{number}_TO_DINT") => Operation::ToInteger(a),
        _ => {
            let kinds: Vec<&str> = arguments.iter().map(Place::kind).collect();
            panic!("function {name} of {kinds:?}")
        }
    }
}

/// Adds a value; returns its index.
fn push<T>(values: &mut Vec<T>, value: T) -> usize {
    values.push(value);
    values.len() - 1
}
