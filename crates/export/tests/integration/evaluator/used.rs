//! Units and variables that statements use, which must be known before translation.

use iecst::{Expr, ExprKind, Stmt, StmtKind};
use std::collections::HashSet;

/// Units and variables that statements use, in capitals.
#[derive(Default)]
pub struct Used {
    /// Variables passed by reference to a function block.
    pub arguments: HashSet<String>,
    /// Functions.
    pub functions: HashSet<String>,
}

impl Used {
    /// Adds the uses of some statements.
    pub fn by(&mut self, statements: &[Stmt]) {
        for statement in statements {
            match &statement.kind {
                StmtKind::Assignment { value, .. } => self.within(value),
                StmtKind::If { condition, then_body, .. } => {
                    self.within(condition);
                    self.by(then_body);
                }
                StmtKind::For { body, .. } => self.by(body),
                StmtKind::Call { args, .. } => {
                    for value in args.iter().filter_map(|a| a.value.as_ref()) {
                        if let ExprKind::Ident(name) = &value.kind {
                            self.arguments.insert(name.to_ascii_uppercase());
                        }
                        self.within(value);
                    }
                }
                _ => {}
            }
        }
    }

    fn within(&mut self, e: &Expr) {
        match &e.kind {
            ExprKind::Paren(inner) | ExprKind::UnaryOp { expr: inner, .. } => self.within(inner),
            ExprKind::BinaryOp { left, right, .. } => {
                self.within(left);
                self.within(right);
            }
            ExprKind::ArrayIndex { indices, .. } => indices.iter().for_each(|i| self.within(i)),
            ExprKind::FunctionCall { name, args } => {
                self.functions.insert(name.to_ascii_uppercase());
                args.iter().filter_map(|a| a.value.as_ref()).for_each(|value| self.within(value));
            }
            _ => {}
        }
    }
}
