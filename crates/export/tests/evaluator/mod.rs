//! Executes function blocks as the standard says: `iecst` reads them, this does what stands there. It knows nothing of how they
//! were made.

use iecst::{BinaryOp, Expr, ExprKind, Stmt, StmtKind, TypeKind, UnaryOp, parse_pou};
use std::collections::HashMap;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Value {
    Number(f64),
    Truth(bool),
}

/// A function block with its memory.
pub struct Instance {
    body: Vec<Stmt>,
    memory: HashMap<String, Value>,
}

impl Instance {
    /// Reads a block; every variable begins as it is declared.
    pub fn parse(text: &str) -> Self {
        let pou = parse_pou(text).unwrap_or_else(|e| panic!("{e:?} in\n{text}"));
        let mut memory = HashMap::new();
        for variable in pou.var_blocks.iter().flat_map(|block| &block.vars) {
            let TypeKind::Simple(kind) = &variable.var_type.kind else { panic!("{variable:?}") };
            let nothing = match kind.to_uppercase().as_str() {
                "BOOL" => Value::Truth(false),
                "LREAL" => Value::Number(0.0),
                other => panic!("{other} is not expected"),
            };
            let value = variable.initial.as_ref().map_or(nothing, |e| evaluated(e, &memory));
            let before = memory.insert(variable.name.to_uppercase(), value);
            assert!(before.is_none(), "{} is declared twice", variable.name);
        }
        Self { body: pou.body, memory }
    }

    /// A variable.
    pub fn value(&self, name: &str) -> f64 {
        match self.memory[&name.to_uppercase()] {
            Value::Number(v) => v,
            Value::Truth(v) => f64::from(u8::from(v)),
        }
    }

    /// Changes a variable.
    pub fn set(&mut self, name: &str, value: f64) {
        let place = self.memory.get_mut(&name.to_uppercase());
        *place.unwrap_or_else(|| panic!("no {name}")) = Value::Number(value);
    }

    /// Calls the block.
    pub fn call(&mut self, inputs: &[(&str, f64)]) {
        self.call_with(inputs, &[]);
    }

    /// Calls the block with some conditions, which are off otherwise.
    pub fn call_with(&mut self, inputs: &[(&str, f64)], conditions: &[(&str, bool)]) {
        for own in ["BRESET", "BPREPARE"] {
            self.memory.insert(own.into(), Value::Truth(false));
        }
        for (name, value) in inputs {
            self.set(name, *value);
        }
        for (name, value) in conditions {
            self.memory.insert(name.to_uppercase(), Value::Truth(*value));
        }
        executed(&self.body, &mut self.memory);
    }
}

fn executed(statements: &[Stmt], memory: &mut HashMap<String, Value>) {
    for statement in statements {
        match &statement.kind {
            StmtKind::Assignment { target, value } => {
                let ExprKind::Ident(name) = &target.kind else { panic!("{target:?}") };
                let value = evaluated(value, memory);
                let place = memory.get_mut(&name.to_uppercase());
                let place = place.unwrap_or_else(|| panic!("{name} is not declared"));
                assert_eq!(
                    std::mem::discriminant(place),
                    std::mem::discriminant(&value),
                    "{name} is of another type"
                );
                *place = value;
            }
            StmtKind::If { condition, then_body, elsif_branches, else_body } => {
                assert!(elsif_branches.is_empty() && else_body.is_none());
                if evaluated(condition, memory) == Value::Truth(true) {
                    executed(then_body, memory);
                }
            }
            StmtKind::Empty => {}
            other => panic!("{other:?}"),
        }
    }
}

fn number(e: &Expr, memory: &HashMap<String, Value>) -> f64 {
    match evaluated(e, memory) {
        Value::Number(v) => v,
        Value::Truth(_) => panic!("a number is expected: {e:?}"),
    }
}

fn truth(e: &Expr, memory: &HashMap<String, Value>) -> bool {
    match evaluated(e, memory) {
        Value::Truth(v) => v,
        Value::Number(_) => panic!("a condition is expected: {e:?}"),
    }
}

fn evaluated(e: &Expr, memory: &HashMap<String, Value>) -> Value {
    match &e.kind {
        ExprKind::RealLiteral(v) => Value::Number(*v),
        ExprKind::BoolLiteral(v) => Value::Truth(*v),
        ExprKind::Ident(name) => {
            *memory.get(&name.to_uppercase()).unwrap_or_else(|| panic!("{name} is not declared"))
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
            let (a, b) = (number(left, memory), number(right, memory));
            match op {
                BinaryOp::Add => Value::Number(a + b),
                BinaryOp::Sub => Value::Number(a - b),
                BinaryOp::Mul => Value::Number(a * b),
                BinaryOp::Div => Value::Number(a / b),
                BinaryOp::Lt => Value::Truth(a < b),
                other => panic!("{other:?}"),
            }
        }
        ExprKind::FunctionCall { name, args } => {
            let arguments: Vec<&Expr> = args.iter().map(|a| a.value.as_ref().unwrap()).collect();
            let of = |k: usize| number(arguments[k], memory);
            Value::Number(match (name.to_uppercase().as_str(), arguments.len()) {
                ("SQRT", 1) => of(0).sqrt(),
                ("EXP", 1) => of(0).exp(),
                ("LN", 1) => of(0).ln(),
                ("SIN", 1) => of(0).sin(),
                ("COS", 1) => of(0).cos(),
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
