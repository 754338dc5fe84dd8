//! Expressions that are given apart from the file, over the names that it declares: weights and derived quantities.

use super::Model;
use super::compile::Compiler;
use super::expression::Expression;
use super::names::Meaning;
use super::parse::parse;
use super::remark::{Error, Remark, Source};
use super::string::Place;
use crate::graph::{Graph, Id, Leaf, Node};
use std::sync::Arc;

impl Model {
    /// Reads a weight of samples: an expression of time, inputs, outputs as they were measured, constants and tables.
    ///
    /// # Errors
    /// A mistake in the text, with its place and the remedy; a name of something else.
    pub fn weight(&self, text: &str) -> Result<(Graph, Id), Error> {
        let outputs = self.document.outputs.iter().enumerate();
        let outputs = outputs.map(|(j, output)| (output.quantity.name.as_str(), Meaning::Measured(j as u32))).collect();
        let allowed = |leaf: Leaf| matches!(leaf, Leaf::Time | Leaf::Input(_) | Leaf::Measured(_));
        self.apart(text, "a weight", "time, inputs and measured outputs", outputs, allowed)
    }

    /// Reads a derived quantity: an expression of parameters, constants and tables, such as `ls/rs`.
    ///
    /// # Errors
    /// A mistake in the text, with its place and the remedy; a name of something else.
    pub fn derived(&self, text: &str) -> Result<(Graph, Id), Error> {
        self.apart(text, "a derived quantity", "parameters and constants", vec![], |leaf| {
            matches!(leaf, Leaf::Parameter(_))
        })
    }

    fn apart(
        &self,
        text: &str,
        what: &'static str,
        of: &str,
        names: Vec<(&str, Meaning)>,
        allowed: impl Fn(Leaf) -> bool,
    ) -> Result<(Graph, Id), Error> {
        let source = Arc::new(Source { name: what.to_owned(), text: text.to_owned() });
        let wrong = |remark: Remark| Error::Wrong(vec![remark]);
        let (nodes, _) = parse(text).map_err(|no| wrong(Remark::error(&source, no.at, no.title).help(no.help)))?;
        let expression = Expression { text: text.to_owned(), nodes, place: Place::plain(0..text.len()) };
        let mut compiler = Compiler::new(&self.document, &self.source).map_err(Error::Wrong)?;
        compiler.names.extend(names);
        let may = |meaning: &Meaning| match *meaning {
            Meaning::Time => allowed(Leaf::Time),
            Meaning::Input(i) => allowed(Leaf::Input(i)),
            Meaning::Parameter(i) => allowed(Leaf::Parameter(i)),
            Meaning::State(i) => allowed(Leaf::State(i)),
            Meaning::Measured(i) => allowed(Leaf::Measured(i)),
            Meaning::Item(item) => item < self.document.constants.len(),
            Meaning::Table(_) => true,
            Meaning::Number(_) => false,
        };
        let mut usable: Vec<&str> =
            compiler.names.iter().filter(|(_, meaning)| may(meaning)).map(|(name, _)| *name).collect();
        usable.sort_unstable();
        let sentence = format!("{what} may use {of}");
        let help = format!("{sentence}: {}", usable.join(", "));
        let mut compiler = compiler.reading(&source, &sentence, usable);
        let Some(root) = compiler.lower(&expression) else { return Err(Error::Wrong(compiler.errors)) };
        let (graph, roots) = compiler.graph.pruned(&[root]);
        let stranger = graph.nodes().iter().find_map(|node| match node {
            Node::Leaf(leaf) if !allowed(*leaf) => Some(*leaf),
            _ => None,
        });
        match (stranger, roots.first()) {
            (None, Some(root)) => Ok((graph, *root)),
            _ => {
                let title = format!("{what} depends on other things than {of}");
                Err(wrong(Remark::error(&source, 0..text.len(), title).help(help)))
            }
        }
    }
}
