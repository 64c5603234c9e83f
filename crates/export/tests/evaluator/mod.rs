//! Executes function blocks as the standard says: `iecst` reads them, this does what stands there. It knows nothing of how they
//! were made.

use iecst::{
    BinaryOp, CallArg, Expr, ExprKind, Pou, Stmt, StmtKind, TypeKind, UnaryOp, VarBlockKind,
    parse_pou,
};
use std::cell::Cell;
use std::collections::HashMap;
use std::rc::Rc;

thread_local! {
    /// By what share functions are off, as those of another platform may be.
    pub static LAST_DIGIT: Cell<f64> = const { Cell::new(0.0) };
}

#[derive(Clone, Debug)]
enum Value {
    Number(f64),
    Integer(i64),
    Truth(bool),
    List(Vec<f64>),
    Block(Instance),
}

/// Names do not depend on case.
type Memory = HashMap<String, Value>;

/// Units by name.
#[derive(Clone, Debug, Default)]
pub struct Library(HashMap<String, Rc<Pou>>);

impl Library {
    /// Reads units.
    pub fn parse<'a>(texts: impl IntoIterator<Item = &'a str>) -> Self {
        let mut units = HashMap::new();
        for text in texts {
            // the parser knows no literals with a type
            let pou = parse_pou(&text.replace("LREAL#", ""))
                .unwrap_or_else(|e| panic!("{e:?} in\n{text}"));
            units.insert(pou.name.to_uppercase(), Rc::new(pou));
        }
        Self(units)
    }

    /// An instance of a unit, those within it included; every variable begins as it is declared.
    pub fn instance(&self, name: &str) -> Instance {
        let unit = self.0.get(&name.to_uppercase()).unwrap_or_else(|| panic!("no unit {name}"));
        let mut memory = Memory::new();
        let blocks = &unit.var_blocks;
        for (block, variable) in blocks.iter().flat_map(|b| b.vars.iter().map(move |v| (b, v))) {
            let TypeKind::Simple(kind) = &variable.var_type.kind else {
                let TypeKind::Array { ranges, .. } = &variable.var_type.kind else {
                    panic!("{variable:?}")
                };
                let Value::Integer(last) = evaluated(&ranges[0].high, &memory) else {
                    panic!("{ranges:?}")
                };
                // a local entry has to be set before it is read, although a PLC begins with zeros
                let is_given = block.kind == VarBlockKind::VarInput;
                let value = if is_given { 0.0 } else { f64::NAN };
                let list = vec![value; last as usize + 1];
                memory.insert(variable.name.to_uppercase(), Value::List(list));
                continue;
            };
            let nothing = match kind.to_uppercase().as_str() {
                "BOOL" => Value::Truth(false),
                "LREAL" => Value::Number(0.0),
                "DINT" => Value::Integer(0),
                other => Value::Block(self.instance(other)),
            };
            let value = variable.initial.as_ref().map_or(nothing, |e| evaluated(e, &memory));
            let before = memory.insert(variable.name.to_uppercase(), value);
            assert!(before.is_none(), "{} is declared twice", variable.name);
        }
        Instance { unit: Rc::clone(unit), memory }
    }
}

/// A function block with its memory.
#[derive(Clone, Debug)]
pub struct Instance {
    unit: Rc<Pou>,
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
        match &self.memory[&name.to_uppercase()] {
            Value::Number(v) => *v,
            other => panic!("{name} is {other:?}"),
        }
    }

    /// Changes a variable.
    pub fn set(&mut self, name: &str, value: f64) {
        assign(&mut self.memory, name, Value::Number(value));
    }

    /// Changes a condition.
    pub fn truth(&mut self, name: &str, value: bool) {
        assign(&mut self.memory, name, Value::Truth(value));
    }

    /// Changes a number of an array.
    pub fn set_in_list(&mut self, name: &str, place: usize, value: f64) {
        match self.memory.get_mut(&name.to_uppercase()) {
            Some(Value::List(list)) => list[place] = value,
            other => panic!("{name} is {other:?}"),
        }
    }

    /// A block within this one.
    pub fn inner(&mut self, name: &str) -> &mut Self {
        match self.memory.get_mut(&name.to_uppercase()) {
            Some(Value::Block(block)) => block,
            other => panic!("{name} is {other:?}"),
        }
    }

    /// All outputs that are numbers, in their order.
    pub fn shown(&self) -> Vec<f64> {
        let outputs = self.unit.var_blocks.iter().filter(|b| b.kind == VarBlockKind::VarOutput);
        let names = outputs.flat_map(|block| &block.vars).map(|variable| &variable.name);
        let number = |name: &String| match &self.memory[&name.to_uppercase()] {
            Value::Number(v) => Some(*v),
            _ => None,
        };
        names.filter_map(number).collect()
    }

    /// Calls the block.
    pub fn call(&mut self, inputs: &[(&str, f64)]) {
        self.call_with(inputs, &[]);
    }

    /// Calls the block with some conditions; `bReset` and `bPrepare` are off otherwise.
    pub fn call_with(&mut self, inputs: &[(&str, f64)], conditions: &[(&str, bool)]) {
        for own in ["bReset", "bPrepare"] {
            assign(&mut self.memory, own, Value::Truth(false));
        }
        for (name, value) in inputs {
            self.set(name, *value);
        }
        for (name, value) in conditions {
            assign(&mut self.memory, name, Value::Truth(*value));
        }
        self.run();
    }

    /// A whole number.
    pub fn count(&self, name: &str) -> i64 {
        match self.memory[&name.to_uppercase()] {
            Value::Integer(v) => v,
            ref other => panic!("{name} is {other:?}"),
        }
    }

    /// A condition.
    pub fn holds(&self, name: &str) -> bool {
        matches!(self.memory[&name.to_uppercase()], Value::Truth(true))
    }

    /// Runs the unit once with the inputs that it has.
    pub fn run(&mut self) {
        let unit = Rc::clone(&self.unit);
        executed(&unit.body, &mut self.memory);
    }
}

fn assign(memory: &mut Memory, name: &str, value: Value) {
    let place = memory.get_mut(&name.to_uppercase());
    let place = place.unwrap_or_else(|| panic!("{name} is not declared"));
    let alike = std::mem::discriminant(place) == std::mem::discriminant(&value);
    assert!(alike, "{name} is of another type than {value:?}");
    *place = value;
}

fn executed(statements: &[Stmt], memory: &mut Memory) {
    for statement in statements {
        match &statement.kind {
            StmtKind::Assignment { target, value } => {
                let value = evaluated(value, memory);
                match &target.kind {
                    ExprKind::Ident(name) => assign(memory, name, value),
                    ExprKind::ArrayIndex { array, indices } => {
                        let ExprKind::Ident(name) = &array.kind else { panic!("{array:?}") };
                        let place = evaluated(&indices[0], memory);
                        let list = memory.get_mut(&name.to_uppercase());
                        match (list, place, value) {
                            (Some(Value::List(list)), Value::Integer(k), Value::Number(v)) => {
                                list[k as usize] = v;
                            }
                            other => panic!("{other:?}"),
                        }
                    }
                    other => panic!("{other:?}"),
                }
            }
            StmtKind::For { var, from, to, by: None, body } => {
                let [from, to] = [from, to].map(|e| integer(e, memory));
                for k in from..=to {
                    assign(memory, var, Value::Integer(k));
                    executed(body, memory);
                }
            }
            StmtKind::If { condition, then_body, elsif_branches, else_body } => {
                assert!(elsif_branches.is_empty() && else_body.is_none());
                if truth(condition, memory) {
                    executed(then_body, memory);
                }
            }
            StmtKind::Call { name, args } => called(name, args, memory),
            StmtKind::Empty => {}
            other => panic!("{other:?}"),
        }
    }
}

/// A block within this one: inputs that are named change, all others stay.
fn called(name: &str, arguments: &[CallArg], memory: &mut Memory) {
    let mut values = Vec::new();
    for argument in arguments {
        let value = evaluated(argument.value.as_ref().unwrap(), memory);
        values.push((argument.name.clone().unwrap(), value));
    }
    let Some(Value::Block(block)) = memory.get_mut(&name.to_uppercase()) else {
        panic!("{name} is no block")
    };
    for (input, value) in values {
        assign(&mut block.memory, &input, value);
    }
    block.run();
}

fn number(e: &Expr, memory: &Memory) -> f64 {
    match evaluated(e, memory) {
        Value::Number(v) => v,
        other => panic!("a number is expected and not {other:?}: {e:?}"),
    }
}

fn integer(e: &Expr, memory: &Memory) -> i64 {
    match evaluated(e, memory) {
        Value::Integer(v) => v,
        other => panic!("a whole number is expected and not {other:?}: {e:?}"),
    }
}

fn truth(e: &Expr, memory: &Memory) -> bool {
    match evaluated(e, memory) {
        Value::Truth(v) => v,
        other => panic!("a condition is expected and not {other:?}: {e:?}"),
    }
}

fn evaluated(e: &Expr, memory: &Memory) -> Value {
    match &e.kind {
        ExprKind::RealLiteral(v) => Value::Number(*v),
        ExprKind::IntLiteral(v) => Value::Integer(*v),
        ExprKind::BoolLiteral(v) => Value::Truth(*v),
        ExprKind::Ident(name) => {
            let value = memory.get(&name.to_uppercase());
            value.unwrap_or_else(|| panic!("{name} is not declared")).clone()
        }
        ExprKind::MemberAccess { expr, member } => {
            let ExprKind::Ident(name) = &expr.kind else { panic!("{expr:?}") };
            let Some(Value::Block(block)) = memory.get(&name.to_uppercase()) else {
                panic!("{name} is no block")
            };
            block.memory[&member.to_uppercase()].clone()
        }
        ExprKind::ArrayIndex { array, indices } => {
            let ExprKind::Ident(name) = &array.kind else { panic!("{array:?}") };
            let Value::Integer(place) = evaluated(&indices[0], memory) else {
                panic!("{indices:?}")
            };
            match &memory[&name.to_uppercase()] {
                Value::List(list) => Value::Number(list[place as usize]),
                other => panic!("{name} is {other:?}"),
            }
        }
        ExprKind::Paren(inner) => evaluated(inner, memory),
        ExprKind::UnaryOp { op: UnaryOp::Neg, expr } => Value::Number(-number(expr, memory)),
        ExprKind::UnaryOp { op: UnaryOp::Not, expr } => Value::Truth(!truth(expr, memory)),
        ExprKind::BinaryOp { left, op: BinaryOp::And, right } => {
            Value::Truth(truth(left, memory) & truth(right, memory))
        }
        ExprKind::BinaryOp { left, op: BinaryOp::Or, right } => {
            Value::Truth(truth(left, memory) | truth(right, memory))
        }
        ExprKind::BinaryOp { left, op, right } => {
            match (evaluated(left, memory), op, evaluated(right, memory)) {
                (Value::Number(a), BinaryOp::Add, Value::Number(b)) => Value::Number(a + b),
                (Value::Number(a), BinaryOp::Sub, Value::Number(b)) => Value::Number(a - b),
                (Value::Number(a), BinaryOp::Mul, Value::Number(b)) => Value::Number(a * b),
                (Value::Number(a), BinaryOp::Div, Value::Number(b)) => Value::Number(a / b),
                (Value::Number(a), BinaryOp::Lt, Value::Number(b)) => Value::Truth(a < b),
                (Value::Number(a), BinaryOp::Gt, Value::Number(b)) => Value::Truth(a > b),
                (Value::Integer(a), BinaryOp::Lt, Value::Integer(b)) => Value::Truth(a < b),
                (Value::Integer(a), BinaryOp::Eq, Value::Integer(b)) => Value::Truth(a == b),
                (Value::Integer(a), BinaryOp::Add, Value::Integer(b)) => Value::Integer(a + b),
                (Value::Integer(a), BinaryOp::Mod, Value::Integer(b)) => Value::Integer(a % b),
                (a, op, b) => panic!("{a:?} {op:?} {b:?}"),
            }
        }
        ExprKind::FunctionCall { name, args } => {
            let arguments: Vec<&Expr> = args.iter().map(|a| a.value.as_ref().unwrap()).collect();
            let of = |k: usize| number(arguments[k], memory);
            let off = 1.0 + LAST_DIGIT.get();
            if let (true, [low, value, high]) =
                (name.eq_ignore_ascii_case("LIMIT"), arguments.as_slice())
                && let Value::Integer(low) = evaluated(low, memory)
            {
                return Value::Integer(integer(value, memory).max(low).min(integer(high, memory)));
            }
            if name.eq_ignore_ascii_case("LREAL_TO_DINT") {
                return Value::Integer(of(0).round_ties_even() as i64);
            }
            Value::Number(match (name.to_uppercase().as_str(), arguments.len()) {
                ("DINT_TO_LREAL", 1) => match evaluated(arguments[0], memory) {
                    Value::Integer(v) => v as f64,
                    other => panic!("{other:?}"),
                },
                ("SQRT", 1) => of(0).sqrt() * off,
                ("EXP", 1) => of(0).exp() * off,
                ("LN", 1) => of(0).ln() * off,
                ("SIN", 1) => of(0).sin() * off,
                ("COS", 1) => of(0).cos() * off,
                ("ABS", 1) => of(0).abs(),
                ("LIMIT", 3) => of(1).max(of(0)).min(of(2)),
                ("SEL", 3) => match truth(arguments[0], memory) {
                    true => of(2),
                    false => of(1),
                },
                other => panic!("{other:?}"),
            })
        }
        other => panic!("{other:?}"),
    }
}
