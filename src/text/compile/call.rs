//! Calls of functions and tables.

use super::{Compiler, Said};
use crate::graph::{Function, Function2, Graph, Id};
use crate::scalar::Comparison;
use crate::text::names::{Callable, Meaning, foreign, function, functions};
use crate::text::remark::nearest;

impl Compiler<'_> {
    /// A function or a table of these arguments.
    ///
    /// # Errors
    /// A name that cannot be called, another number of arguments; nothing where that was said already.
    pub(super) fn call(&mut self, name: &str, order: [u8; 2], arguments: &[Id]) -> Result<Id, Option<Said>> {
        let count = |expected: &str, is_right: bool| match is_right {
            true => Ok(()),
            false => Err(Some((format!("`{name}` takes {expected}, not {}", arguments.len()), None))),
        };
        if let Some(Meaning::Table(table)) = self.names.get(name) {
            let table = &self.document.tables[*table].table;
            return match (table.grid().is_surface(), arguments) {
                (false, [x]) if order[1] == 0 => Ok(self.graph.table(table, order, [*x, *x])),
                (true, [x, y]) => Ok(self.graph.table(table, order, [*x, *y])),
                (false, [_]) => Err(Some((format!("table `{name}` has no `y`"), None))),
                (is_surface, _) => {
                    Err(count(if is_surface { "two arguments" } else { "one argument" }, false).unwrap_err())
                }
            };
        }
        if order != [0, 0] {
            let help = "a slope `.x` is that of a table of [tables]".to_owned();
            return Err(Some((format!("`{name}` is no table"), Some(help))));
        }
        let Some(callable) = function(name) else { return Err(Some(self.uncallable(name))) };
        let joined = |graph: &mut Graph, function| {
            arguments[1..].iter().fold(arguments[0], |a, b| graph.function2(function, a, *b))
        };
        match callable {
            Callable::One(function) => {
                count("one argument", arguments.len() == 1)?;
                Ok(self.graph.function(function, arguments[0]))
            }
            Callable::Two(Function2::RemEuclid) => {
                count("two arguments", arguments.len() == 2)?;
                if self.graph.known(arguments[1]).is_none() {
                    let help = "the period must be a number or a constant".to_owned();
                    return Err(Some(("the period of `rem_euclid` is not constant".to_owned(), Some(help))));
                }
                Ok(self.graph.function2(Function2::RemEuclid, arguments[0], arguments[1]))
            }
            Callable::Two(function) => {
                count("two arguments", arguments.len() == 2)?;
                Ok(self.graph.function2(function, arguments[0], arguments[1]))
            }
            Callable::Max | Callable::Min => {
                count("two arguments or more", arguments.len() >= 2)?;
                let function = if callable == Callable::Max { Function2::Max } else { Function2::Min };
                Ok(joined(&mut self.graph, function))
            }
            Callable::Clamp => {
                count("three arguments", arguments.len() == 3)?;
                let [x, low, high] = [arguments[0], arguments[1], arguments[2]];
                // As `Scalar::clamp` of a symbol.
                let above = self.graph.select(Comparison::Less, x, low, low, x);
                Ok(self.graph.select(Comparison::Less, high, x, high, above))
            }
            Callable::Fract => {
                count("one argument", arguments.len() == 1)?;
                let whole = self.graph.function(Function::Trunc, arguments[0]);
                Ok(self.graph.sub(arguments[0], whole))
            }
        }
    }

    fn uncallable(&self, name: &str) -> Said {
        if let Some(help) = foreign(name) {
            return (format!("there is no function `{name}`"), Some(help.to_owned()));
        }
        if self.names.contains_key(name) {
            return (format!("`{name}` is no function"), Some(format!("for a product write {name}*(...)")));
        }
        let tables = self.document.tables.iter().map(|table| table.quantity.name.clone());
        let known: Vec<String> = functions().map(str::to_owned).chain(tables).collect();
        let near = nearest(name, known.iter().map(String::as_str));
        let help = near.map_or_else(
            || format!("functions: {}", functions().collect::<Vec<_>>().join(", ")),
            |near| format!("did you mean `{near}`?"),
        );
        (format!("there is no function `{name}`"), Some(help))
    }
}
