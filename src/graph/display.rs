//! Graphs as text: infix expressions, what is used more than once under a name of its own. They are those of a text model
//! (`crate::text`).

use super::{Graph, Id, Leaf, Node};
use crate::scalar::Comparison;
use core::fmt::{self, Display, Write};

/// The name of each leaf.
pub(crate) type Naming<'a> = &'a dyn Fn(Leaf) -> String;

/// Expressions longer than this get a name.
const LONG: usize = 100;

/// How tightly an expression holds together.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Binding {
    Condition,
    Sum,
    Product,
    Atom,
}

type Text = (String, Binding);

impl Graph {
    /// Lines `name = expression`: first what the roots share, then the roots.
    pub(crate) fn write(&self, to: &mut dyn Write, naming: Naming<'_>, roots: &[(String, Id)]) -> fmt::Result {
        let lines = self.lines(naming, ["_", "table"], roots);
        lines.iter().try_for_each(|(name, expression)| writeln!(to, "{name} = {expression}"))
    }

    /// Names and expressions: first what the roots share, as `_1`, then the roots. Tables are called `table0`; both words are
    /// given.
    pub(crate) fn lines(
        &self,
        naming: Naming<'_>,
        [shared, table]: [&str; 2],
        roots: &[(String, Id)],
    ) -> Vec<(String, String)> {
        let ids: Vec<Id> = roots.iter().map(|(_, id)| *id).collect();
        let reached = self.reached(&ids);
        let mut uses = vec![0u32; self.len()];
        for (_, node) in self.nodes().iter().enumerate().filter(|(i, _)| reached[*i]) {
            node.operands().for_each(|operand| uses[operand.index()] += 1);
        }
        let mut texts: Vec<Text> = Vec::with_capacity(self.len());
        let mut lines = vec![];
        for (i, node) in self.nodes().iter().enumerate() {
            if !reached[i] {
                texts.push((String::new(), Binding::Atom));
                continue;
            }
            let (text, binding) = expression(node, naming, table, &texts);
            let short = matches!(node, Node::Constant(_) | Node::Leaf(_) | Node::Neg(_));
            if !short && uses[i] > 0 && (uses[i] > 1 || text.len() > LONG) {
                let name = format!("{shared}{}", lines.len() + 1);
                lines.push((name.clone(), text));
                texts.push((name, Binding::Atom));
            } else {
                texts.push((text, binding));
            }
        }
        let root = |(name, id): &(String, Id)| {
            let text = texts.get(id.index()).map_or("nan", |(text, _)| text);
            (name.clone(), text.to_owned())
        };
        lines.extend(roots.iter().map(root));
        lines
    }
}

impl Graph {
    /// A root in one line.
    pub(crate) fn one_line(&self, root: Id, naming: Naming<'_>) -> String {
        let mut text = String::new();
        // A string takes what is written.
        let _ = self.write(&mut text, naming, &[(String::new(), root)]);
        text.lines().map(|line| line.trim_start_matches(" = ")).collect::<Vec<_>>().join("; ")
    }
}

fn expression(node: &Node, naming: Naming<'_>, table_word: &str, texts: &[Text]) -> Text {
    let plain = |id: Id| texts[id.index()].0.as_str();
    let within = |id: Id, least: Binding| {
        let (text, binding) = &texts[id.index()];
        if *binding < least { format!("({text})") } else { text.clone() }
    };
    match *node {
        Node::Constant(constant) if constant.value().is_nan() => ("nan".to_owned(), Binding::Atom),
        Node::Constant(constant) => (format!("{:?}", constant.value()), Binding::Atom),
        Node::Leaf(leaf) => (naming(leaf), Binding::Atom),
        Node::Neg(a) => (format!("-{}", within(a, Binding::Product)), Binding::Sum),
        Node::Add(a, b) => (format!("{} + {}", within(a, Binding::Sum), within(b, Binding::Product)), Binding::Sum),
        Node::Sub(a, b) => (format!("{} - {}", within(a, Binding::Sum), within(b, Binding::Product)), Binding::Sum),
        Node::Mul(a, b) => {
            (format!("{} * {}", within(a, Binding::Product), within(b, Binding::Atom)), Binding::Product)
        }
        Node::Div(a, b) => {
            (format!("{} / {}", within(a, Binding::Product), within(b, Binding::Atom)), Binding::Product)
        }
        Node::MulAdd([a, b, c]) => {
            let product = format!("{} * {}", within(a, Binding::Product), within(b, Binding::Atom));
            (format!("{} + {product}", within(c, Binding::Sum)), Binding::Sum)
        }
        Node::Power(a, n) => (format!("{}^{n}", within(a, Binding::Atom)), Binding::Product),
        Node::Function(function, a) => (format!("{}({})", function.name(), plain(a)), Binding::Atom),
        Node::Function2(function, a, b) => (format!("{}({}, {})", function.name(), plain(a), plain(b)), Binding::Atom),
        Node::Table { table, order, at: [a, b] } => {
            let slope = "x".repeat(order[0].into()) + &"y".repeat(order[1].into());
            let name = format!("{table_word}{table}{}{slope}", if slope.is_empty() { "" } else { "." });
            let second = if a == b { String::new() } else { format!(", {}", plain(b)) };
            (format!("{name}({}{second})", plain(a)), Binding::Atom)
        }
        Node::Select(comparison, [a, b, c, d]) => {
            let (a, b) = (within(a, Binding::Sum), within(b, Binding::Sum));
            let condition = match comparison {
                Comparison::Less => format!("{a} < {b}"),
                Comparison::LessOrEqual => format!("{a} <= {b}"),
                Comparison::Equal => format!("{a} <= {b} and {b} <= {a}"),
            };
            (format!("if {condition} then {} else {}", within(c, Binding::Sum), plain(d)), Binding::Condition)
        }
    }
}

/// A leaf where nothing has a name.
fn numbered(leaf: Leaf) -> String {
    match leaf {
        Leaf::Time => "t".to_owned(),
        Leaf::Step => "h".to_owned(),
        Leaf::State(i) => format!("x{i}"),
        Leaf::Input(i) => format!("u{i}"),
        Leaf::NextInput(i) => format!("u{i}'"),
        Leaf::Measured(i) => format!("y{i}"),
        Leaf::Parameter(i) => format!("p{i}"),
        Leaf::Late { input, after } => format!("u{input}[{after}]"),
    }
}

impl Display for Graph {
    /// Shows the graph, with the nodes that no other node uses as its roots.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut used = vec![false; self.len()];
        self.nodes().iter().flat_map(Node::operands).for_each(|operand| used[operand.index()] = true);
        let free = (0..self.len()).filter(|i| !used[*i]);
        let roots: Vec<_> = free.map(|i| (format!("[{i}]"), Id::new(i))).collect();
        self.write(f, &numbered, &roots)
    }
}
