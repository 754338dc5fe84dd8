//! From a [`Document`] to [`Equations`].

mod call;

use super::document::{Document, State};
use super::expression::{At, Expression, Operation, Relation, Sign};
use super::names::{Meaning, Names, function, items, names, order};
use super::remark::{Remark, Source, nearest};
use crate::equations::{Equations, Roots};
use crate::graph::{Function2, Graph, Id, Leaf, Node};
use crate::layout::{Layout, Quantity};
use crate::scalar::Comparison;
use std::sync::Arc;

/// The equations of a document, and the order of its items.
pub(super) fn compile(document: &Document, source: &Arc<Source>) -> Result<Equations, Vec<Remark>> {
    let mut compiler = Compiler::new(document, source)?;
    let state = compiler.rates(document);
    let output = document.outputs.iter().filter_map(|one| compiler.lower(&one.value)).collect();
    let jump = compiler.jumps(document);
    let diffusion = document.states.iter().map(|one| one.diffusion.as_ref());
    let diffusion = compiler.levels(diffusion, 0.0, "the diffusion", May::All);
    let noise = compiler.levels(document.outputs.iter().map(|one| one.noise.as_ref()), f64::NAN, "the noise", May::All);
    let initial = document.states.iter().map(|one| one.initial_noise.as_ref());
    let initial_noise = compiler.levels(initial, 0.0, "the initial noise", May::Parameters);
    let initial = document.states.iter().map(State::initial);
    let initial = compiler.each(initial, f64::NAN, "the initial state", May::Inputs);
    let delay =
        compiler.levels(document.inputs.iter().map(|one| one.delay.as_ref()), 0.0, "the dead time", May::Parameters);
    if !compiler.errors.is_empty() {
        return Err(compiler.errors);
    }
    let roots = Roots { state, output, diffusion, noise, initial_noise, initial, delay, jump };
    let made = Equations::complete(layout(document), &compiler.graph, &roots);
    made.map_err(|wrong| vec![Remark::error(source, 0..0, wrong.to_string())])
}

fn layout(document: &Document) -> Layout {
    let quantity =
        |declared: &super::document::Declared| Quantity { name: declared.name.clone(), unit: declared.unit.clone() };
    Layout {
        kind: document.kind,
        states: document.states.iter().map(|one| quantity(&one.quantity)).collect(),
        inputs: document.inputs.iter().map(|one| quantity(&one.quantity)).collect(),
        outputs: document.outputs.iter().map(|one| quantity(&one.quantity)).collect(),
        parameters: document.parameters.iter().map(|one| quantity(&one.quantity)).collect(),
    }
}

/// What an expression may depend on, beside constants.
#[derive(Clone, Copy)]
enum May {
    Parameters,
    /// These and inputs.
    Inputs,
    All,
}

impl May {
    fn depends_on(self, leaf: Leaf) -> bool {
        match leaf {
            Leaf::State(_) | Leaf::Time => matches!(self, May::All),
            Leaf::Input(_) => !matches!(self, May::Parameters),
            _ => true,
        }
    }

    /// What it depends on in vain, and the remedy.
    fn sentence(self) -> &'static str {
        match self {
            May::Parameters => "a state, an input or time; it may depend on parameters and constants",
            _ => "a state or time; it may depend on parameters, inputs and constants",
        }
    }
}

/// Reads expressions into a graph.
pub(super) struct Compiler<'d> {
    document: &'d Document,
    source: &'d Arc<Source>,
    pub names: Names<'d>,
    /// The node of each constant and definition.
    items: Vec<Option<Id>>,
    pub graph: Graph,
    pub errors: Vec<Remark>,
    /// What an expression apart from the file may use, in a sentence, and the names of it.
    apart: Option<(String, Vec<&'d str>)>,
}

impl<'d> Compiler<'d> {
    /// With the constants and the definitions of the document.
    pub fn new(document: &'d Document, source: &'d Arc<Source>) -> Result<Self, Vec<Remark>> {
        let names = names(document);
        let order = order(document, &names, source).map_err(|circle| vec![circle])?;
        let expressions = items(document);
        let (items, graph, errors) = (vec![None; expressions.len()], Graph::default(), vec![]);
        let mut compiler = Compiler { document, source, names, items, graph, errors, apart: None };
        for item in order {
            let set = document.constants.get(item).and_then(|constant| constant.set);
            let id = match set {
                Some(value) => Some(compiler.graph.constant(value)),
                None => compiler.lower(expressions[item]),
            };
            if let (Some(id), true) = (id, item < document.constants.len()) {
                compiler.check_constant(item, id, expressions[item]);
            }
            compiler.items[item] = id;
        }
        match compiler.errors.is_empty() {
            true => Ok(compiler),
            // What names an item that is wrong is not wrong itself.
            false => Err(compiler.errors),
        }
    }

    /// This compiler for expressions of another text, which may use what the sentence says, of these names.
    pub fn reading(self, source: &'d Arc<Source>, sentence: &str, names: Vec<&'d str>) -> Self {
        Compiler { source, apart: Some((sentence.to_owned(), names)), ..self }
    }

    /// The value of a constant, by its number.
    pub fn constant(&self, item: usize) -> Option<f64> {
        self.graph.known(*self.items.get(item)?.as_ref()?)
    }

    fn check_constant(&mut self, item: usize, id: Id, expression: &Expression) {
        let name = &self.document.constants[item].quantity.name;
        let remark = |title: String| Remark::error(self.source, expression.whole(), title);
        let remark = match self.graph.known(id) {
            Some(value) if value.is_finite() => return,
            Some(value) => remark(format!("constant `{name}` is {value}; it must be finite")),
            None => remark(format!("constant `{name}` depends on a quantity that is not constant"))
                .help("define it under [let]".to_owned()),
        };
        self.errors.push(remark);
    }

    /// The derivative or next value of each state; zero of one that samples alone change.
    fn rates(&mut self, document: &Document) -> Vec<Id> {
        let mut found = vec![];
        for state in &document.states {
            let id = match &state.rate {
                Some(rate) => self.lower(rate),
                None => Some(self.graph.constant(0.0)),
            };
            found.extend(id);
        }
        found
    }

    /// Each state after a sample; none if samples change no state.
    fn jumps(&mut self, document: &Document) -> Vec<Id> {
        if document.states.iter().all(|state| state.jump.is_none()) {
            return vec![];
        }
        let mut found = vec![];
        for (i, state) in (0..).zip(&document.states) {
            let id = match &state.jump {
                Some(jump) => self.lower(jump),
                None => Some(self.graph.leaf(Leaf::State(i))),
            };
            found.extend(id);
        }
        found
    }

    /// One level for each, where one is given, which is not negative.
    fn levels<'e>(
        &mut self,
        expressions: impl Iterator<Item = Option<&'e Expression>> + Clone,
        unsaid: f64,
        what: &str,
        may: May,
    ) -> Vec<Id> {
        let found = self.each(expressions.clone(), unsaid, what, may);
        for (expression, id) in expressions.zip(&found) {
            if let Some(expression) = expression
                && self.graph.known(*id).is_some_and(|level| !(level >= 0.0 && level.is_finite()))
            {
                let title = format!("{what} must be finite and not negative");
                self.errors.push(Remark::error(self.source, expression.whole(), title));
            }
        }
        found
    }

    /// One node for each; none where no expression is given.
    fn each<'e>(
        &mut self,
        expressions: impl Iterator<Item = Option<&'e Expression>> + Clone,
        unsaid: f64,
        what: &str,
        may: May,
    ) -> Vec<Id> {
        if expressions.clone().all(|one| one.is_none()) {
            return vec![];
        }
        let mut found = vec![];
        for expression in expressions {
            let Some(expression) = expression else {
                found.push(self.graph.constant(unsaid));
                continue;
            };
            // What is wrong is an error already; the number keeps the place.
            let id = self.lower(expression).unwrap_or_else(|| self.graph.constant(0.0));
            let reached = self.graph.reached(&[id]);
            let mut nodes = self.graph.nodes().iter().zip(reached).filter(|(_, reached)| *reached);
            if nodes.any(|(node, _)| matches!(node, Node::Leaf(leaf) if !may.depends_on(*leaf))) {
                let title = format!("{what} depends on {}", may.sentence());
                self.errors.push(Remark::error(self.source, expression.whole(), title));
            }
            found.push(id);
        }
        found
    }

    /// The node of an expression, or an error among the others.
    pub fn lower(&mut self, expression: &Expression) -> Option<Id> {
        let mut values: Vec<Id> = Vec::with_capacity(expression.nodes.len());
        for (at, node) in expression.nodes.iter().enumerate() {
            let value = match &node.operation {
                Operation::Number(value) => Ok(self.graph.constant(*value)),
                Operation::Name(name) => self.named(name),
                Operation::Negate(a) => Ok(self.graph.neg(values[*a])),
                Operation::Binary(sign, a, b) => Ok(self.binary(*sign, values[*a], values[*b])),
                Operation::Call { name, order, arguments } => {
                    let arguments: Vec<Id> = arguments.iter().map(|at| values[*at]).collect();
                    self.call(name, *order, &arguments)
                }
                Operation::If([condition, then, otherwise]) => {
                    Ok(self.select(expression, &values, *condition, values[*then], values[*otherwise]))
                }
                // A condition is no number; a select reads its parts.
                _ => Ok(Id::default()),
            };
            match value {
                Ok(id) => values.push(id),
                Err(wrong) => {
                    let (title, help) = wrong?;
                    let span = expression.span(&self.source.text, at);
                    self.errors.push(Remark::error(self.source, span, title).help(help));
                    return None;
                }
            }
        }
        values.pop()
    }

    /// A quantity by its name. The error is its sentence and the remedy, or nothing if there is an error already.
    fn named(&mut self, name: &str) -> Result<Id, Option<Said>> {
        let Some(meaning) = self.names.get(name).copied() else { return Err(Some(self.unknown(name))) };
        Ok(match meaning {
            Meaning::Number(value) => self.graph.constant(value),
            Meaning::Time => self.graph.leaf(Leaf::Time),
            Meaning::Input(i) => self.graph.leaf(Leaf::Input(i)),
            Meaning::Parameter(i) => self.graph.leaf(Leaf::Parameter(i)),
            Meaning::State(i) => self.graph.leaf(Leaf::State(i)),
            Meaning::Measured(i) => self.graph.leaf(Leaf::Measured(i)),
            Meaning::Item(item) => self.items[item].ok_or(None)?,
            Meaning::Table(_) => {
                return Err(Some((
                    format!("`{name}` is a table"),
                    Some(format!("call it with its argument: {name}(x)")),
                )));
            }
        })
    }

    fn unknown(&self, name: &str) -> Said {
        if function(name).is_some() {
            return (format!("`{name}` is a function"), Some(format!("call it with its argument: {name}(x)")));
        }
        let near = match &self.apart {
            Some((_, names)) => nearest(name, names.iter().copied()),
            None => nearest(name, self.names.keys().copied()),
        };
        let help = match (near, &self.apart) {
            (Some(near), _) => format!("did you mean `{near}`?"),
            (None, Some((sentence, names))) => format!("{sentence}: {}", names.join(", ")),
            (None, None) => "declare it under [constants], [inputs], [parameters], [states] or [let]".to_owned(),
        };
        (format!("nothing is called `{name}`"), Some(help))
    }

    fn binary(&mut self, sign: Sign, a: Id, b: Id) -> Id {
        match sign {
            Sign::Add => self.graph.add(a, b),
            Sign::Sub => self.graph.sub(a, b),
            Sign::Mul => self.graph.mul(a, b),
            Sign::Div => self.graph.div(a, b),
            Sign::Power => match self.graph.known(b) {
                Some(n) if n.fract() == 0.0 && n.abs() <= 1024.0 => self.graph.power(a, n as i32),
                _ => self.graph.function2(Function2::Pow, a, b),
            },
        }
    }

    /// `then` where a condition holds, else `otherwise`.
    fn select(
        &mut self,
        expression: &Expression,
        values: &[Id],
        mut condition: At,
        mut then: Id,
        mut otherwise: Id,
    ) -> Id {
        // Chains of `and`, `or` and `not` lean to the left, where they may be long; to the right they nest, which is limited.
        loop {
            match expression.nodes[condition].operation {
                Operation::And(a, b) => {
                    then = self.select(expression, values, b, then, otherwise);
                    condition = a;
                }
                Operation::Or(a, b) => {
                    otherwise = self.select(expression, values, b, then, otherwise);
                    condition = a;
                }
                Operation::Not(a) => {
                    (then, otherwise) = (otherwise, then);
                    condition = a;
                }
                Operation::Compare(relation, a, b) => {
                    let (a, b) = (values[a], values[b]);
                    let (comparison, a, b) = match relation {
                        Relation::Less => (Comparison::Less, a, b),
                        Relation::LessOrEqual => (Comparison::LessOrEqual, a, b),
                        Relation::Greater => (Comparison::Less, b, a),
                        Relation::GreaterOrEqual => (Comparison::LessOrEqual, b, a),
                    };
                    return self.graph.select(comparison, a, b, then, otherwise);
                }
                _ => return otherwise,
            }
        }
    }
}

/// What is wrong, and the remedy.
type Said = (String, Option<String>);
