//! From the text of an expression to its nodes, by precedence climbing (M. Richards, C. Whitby-Strevens, *BCPL: the
//! language and its compiler*, 1979).
//!
//! From loose to tight: `or`, `and`, `not`, comparisons, `+ -`, `* /`, signs, `^`. So `-x^2` is `-(x^2)`; powers are read from the
//! right: `2^3^2` is `2^(3^2)`; all else from the left.

use super::expression::{At, Node, Operation, Relation, Sign};
use super::lex::{Token, Wrong, tokens};
use super::remark::Span;

/// Parentheses, signs, powers and branches in each other: each takes a few calls on the stack.
const MAX_NESTING: usize = 200;
/// Nodes of one expression.
const MAX_NODES: usize = 200_000;

/// Binding strength of what stands left of an operand: a sign, `not`.
const OF_NOT: u8 = 5;
const OF_MINUS: u8 = 11;

/// The nodes of a text, and what is said of them though they are understood.
pub(super) fn parse(text: &str) -> Result<(Vec<Node>, Vec<Wrong>), Wrong> {
    let mut parser = Parser { tokens: tokens(text)?, next: 0, nodes: vec![], hints: vec![], depth: 0 };
    if parser.peek() == &Token::End {
        return Err(Wrong::new(0..text.len(), "the expression is empty"));
    }
    let whole = parser.expression(0)?;
    match parser.peek() {
        Token::End => parser.number(whole).map(|_| (parser.nodes, parser.hints)),
        _ => Err(parser.unexpected("an operator")),
    }
}

struct Parser {
    tokens: Vec<(Token, Span)>,
    next: usize,
    nodes: Vec<Node>,
    hints: Vec<Wrong>,
    depth: usize,
}

/// Strength to the left and to the right of a sign between two operands.
fn strength(sign: &str) -> Option<(u8, u8)> {
    Some(match sign {
        "or" => (1, 2),
        "and" => (3, 4),
        "<" | "<=" | ">" | ">=" => (6, 7),
        "+" | "-" => (8, 9),
        "*" | "/" => (9, 10),
        "^" | "**" => (14, 13),
        _ => return None,
    })
}

impl Parser {
    fn peek(&self) -> &Token {
        &self.tokens[self.next].0
    }

    fn here(&self) -> Span {
        self.tokens[self.next].1.clone()
    }

    fn take(&mut self) -> (Token, Span) {
        let token = self.tokens[self.next].clone();
        self.next = (self.next + 1).min(self.tokens.len() - 1);
        token
    }

    fn take_sign(&mut self, sign: &str) -> bool {
        let is_there = matches!(self.peek(), Token::Sign(found) if *found == sign);
        if is_there {
            self.take();
        }
        is_there
    }

    fn unexpected(&self, wanted: &str) -> Wrong {
        let shown = match self.peek() {
            Token::End => return Wrong::new(self.here(), format!("the expression ends where {wanted} should follow")),
            Token::Number(number) => number.to_string(),
            Token::Name(name) => name.clone(),
            Token::Sign(sign) => (*sign).to_owned(),
        };
        let wrong = Wrong::new(self.here(), format!("`{shown}` stands where {wanted} should follow"));
        match self.peek() {
            Token::Number(_) | Token::Name(_) | Token::Sign("(") if wanted == "an operator" => {
                wrong.help("write `*` for a product")
            }
            Token::Sign(",") if wanted == "an operator" => wrong.help("decimals are written with a point: 1.5"),
            Token::Sign(")") if wanted == "an operator" => wrong.help("it closes no parenthesis"),
            _ => wrong,
        }
    }

    fn put(&mut self, operation: Operation, span: Span) -> Result<(At, Span), Wrong> {
        if self.nodes.len() >= MAX_NODES {
            return Err(Wrong::new(span, format!("an expression has more than {MAX_NODES} operations")));
        }
        self.nodes.push(Node { operation, span: span.clone() });
        Ok((self.nodes.len() - 1, span))
    }

    /// A number, not something that is true or false.
    fn number(&self, (at, span): (At, Span)) -> Result<At, Wrong> {
        match self.nodes[at].operation.is_condition() {
            true => Err(Wrong::new(span, "this is true or false, where a number should stand")
                .help("write `if ... then 1 else 0`")),
            false => Ok(at),
        }
    }

    /// Something that is true or false, not a number.
    fn condition(&self, (at, span): (At, Span)) -> Result<At, Wrong> {
        match self.nodes[at].operation.is_condition() {
            true => Ok(at),
            false => Err(Wrong::new(span, "this is a number, where a condition should stand")
                .help("write a comparison, such as `x > 0`")),
        }
    }

    fn deeper(&mut self) -> Result<(), Wrong> {
        self.depth += 1;
        match self.depth > MAX_NESTING {
            true => Err(Wrong::new(self.here(), format!("the expression is nested more than {MAX_NESTING} deep"))
                .help("give its inner parts names in `[let]`")),
            false => Ok(()),
        }
    }

    /// What binds at least as tightly as `least`, with its place.
    fn expression(&mut self, least: u8) -> Result<(At, Span), Wrong> {
        self.deeper()?;
        let mut left = self.operand()?;
        while let Token::Sign(sign) = *self.peek() {
            let Some((to_left, to_right)) = strength(sign) else { break };
            if to_left < least {
                break;
            }
            let (_, at) = self.take();
            if sign == "**" {
                self.hints.push(Wrong::new(at, "`**` is read as `^`").help("a power is written `x^2`"));
            }
            let right = self.expression(to_right)?;
            let span = left.1.start..right.1.end;
            let operation = self.joined(sign, left, right)?;
            left = self.put(operation, span)?;
            let is_comparison = |sign: &Token| matches!(sign, Token::Sign("<" | "<=" | ">" | ">="));
            if to_left == 6 && is_comparison(self.peek()) {
                return Err(Wrong::new(self.here(), "comparisons do not form a chain").help("write `a < b and b < c`"));
            }
        }
        self.depth -= 1;
        Ok(left)
    }

    fn joined(&self, sign: &str, left: (At, Span), right: (At, Span)) -> Result<Operation, Wrong> {
        if let "and" | "or" = sign {
            let (a, b) = (self.condition(left)?, self.condition(right)?);
            return Ok(if sign == "and" { Operation::And(a, b) } else { Operation::Or(a, b) });
        }
        let (a, b) = (self.number(left)?, self.number(right)?);
        Ok(match sign {
            "<" => Operation::Compare(Relation::Less, a, b),
            "<=" => Operation::Compare(Relation::LessOrEqual, a, b),
            ">" => Operation::Compare(Relation::Greater, a, b),
            ">=" => Operation::Compare(Relation::GreaterOrEqual, a, b),
            "+" => Operation::Binary(Sign::Add, a, b),
            "-" => Operation::Binary(Sign::Sub, a, b),
            "*" => Operation::Binary(Sign::Mul, a, b),
            "/" => Operation::Binary(Sign::Div, a, b),
            _ => Operation::Binary(Sign::Power, a, b),
        })
    }

    /// A number, a name, a call, something in parentheses, or an operand behind a sign.
    fn operand(&mut self) -> Result<(At, Span), Wrong> {
        if !matches!(self.peek(), Token::Number(_) | Token::Name(_) | Token::Sign("(" | "-" | "+" | "not" | "if")) {
            return Err(self.unexpected("a number or a name"));
        }
        let (token, span) = self.take();
        match token {
            Token::Number(value) => self.put(Operation::Number(value), span),
            Token::Name(name) => self.name(name, span),
            Token::Sign("(") => {
                let inner = self.expression(0)?;
                let end = self.here().end;
                match self.take_sign(")") {
                    true => Ok((inner.0, span.start..end)),
                    false if self.peek() == &Token::End => {
                        Err(Wrong::new(span, "this parenthesis is not closed").help("add `)`"))
                    }
                    false => Err(self.unexpected("`)` or an operator")),
                }
            }
            Token::Sign("not") => {
                let operand = self.expression(OF_NOT)?;
                let whole = span.start..operand.1.end;
                let operand = self.condition(operand)?;
                self.put(Operation::Not(operand), whole)
            }
            Token::Sign("if") => self.branches(span.start),
            Token::Sign(sign) => {
                let operand = self.expression(OF_MINUS)?;
                let whole = span.start..operand.1.end;
                let operand = self.number(operand)?;
                if sign == "+" { Ok((operand, whole)) } else { self.put(Operation::Negate(operand), whole) }
            }
            Token::End => Err(self.unexpected("a number or a name")),
        }
    }

    fn branches(&mut self, start: usize) -> Result<(At, Span), Wrong> {
        let condition = self.expression(0)?;
        let condition = self.condition(condition)?;
        if !self.take_sign("then") {
            return Err(self.unexpected("`then`").help("write `if a < b then c else d`"));
        }
        let then = self.expression(0)?;
        let then = self.number(then)?;
        if !self.take_sign("else") {
            return Err(self.unexpected("`else`").help("write `if a < b then c else d`: both sides are needed"));
        }
        let otherwise = self.expression(0)?;
        let end = otherwise.1.end;
        let otherwise = self.number(otherwise)?;
        self.put(Operation::If([condition, then, otherwise]), start..end)
    }

    /// A quantity, or a function or table with its arguments.
    fn name(&mut self, name: String, span: Span) -> Result<(At, Span), Wrong> {
        let mut order = [0; 2];
        if self.take_sign(".") {
            let (axes, at) = self.take();
            let Token::Name(axes) = axes else { return Err(Wrong::new(at, "the axes of a slope should follow")) };
            for axis in axes.chars() {
                match axis {
                    'x' if order[0] < 2 => order[0] += 1,
                    'y' if order[1] < 2 => order[1] += 1,
                    _ => {
                        return Err(Wrong::new(at, format!("`{axes}` is no slope of a table"))
                            .help("write `.x` or `.y` for the slope along an axis, `.xy` or `.xx` for a second one"));
                    }
                }
            }
            if !matches!(self.peek(), Token::Sign("(")) {
                return Err(self.unexpected("`(`"));
            }
        }
        if !self.take_sign("(") {
            return self.put(Operation::Name(name), span);
        }
        let mut arguments = vec![];
        if !self.take_sign(")") {
            loop {
                let argument = self.expression(0)?;
                arguments.push(self.number(argument)?);
                if self.take_sign(")") {
                    break;
                }
                if !self.take_sign(",") {
                    return Err(self.unexpected("`,` or `)`"));
                }
            }
        }
        let end = self.tokens[self.next - 1].1.end;
        self.put(Operation::Call { name, order, arguments }, span.start..end)
    }
}

#[cfg(test)]
mod tests;
