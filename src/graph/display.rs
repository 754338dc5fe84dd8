//! Graphs as text: infix expressions, what is used more than once under a name of its own.

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
        let ids: Vec<Id> = roots.iter().map(|(_, id)| *id).collect();
        let reached = self.reached(&ids);
        let mut uses = vec![0u32; self.len()];
        for (_, node) in self.nodes().iter().enumerate().filter(|(i, _)| reached[*i]) {
            node.operands().for_each(|operand| uses[operand.index()] += 1);
        }
        let mut texts: Vec<Text> = Vec::with_capacity(self.len());
        let mut named = 0;
        for (i, node) in self.nodes().iter().enumerate() {
            if !reached[i] {
                texts.push((String::new(), Binding::Atom));
                continue;
            }
            let (text, binding) = expression(node, naming, &texts);
            let short = matches!(node, Node::Constant(_) | Node::Leaf(_) | Node::Neg(_));
            if !short && uses[i] > 0 && (uses[i] > 1 || text.len() > LONG) {
                named += 1;
                writeln!(to, "_{named} = {text}")?;
                texts.push((format!("_{named}"), Binding::Atom));
            } else {
                texts.push((text, binding));
            }
        }
        for (name, id) in roots {
            writeln!(to, "{name} = {}", texts.get(id.index()).map_or("NaN", |(text, _)| text))?;
        }
        Ok(())
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

fn expression(node: &Node, naming: Naming<'_>, texts: &[Text]) -> Text {
    let plain = |id: Id| texts[id.index()].0.as_str();
    let within = |id: Id, least: Binding| {
        let (text, binding) = &texts[id.index()];
        if *binding < least { format!("({text})") } else { text.clone() }
    };
    match *node {
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
            let primes = |order: u8, name: &str| name.repeat(order.into());
            let name = format!("table{table}{}{}", primes(order[0], "_x"), primes(order[1], "_y"));
            let second = if a == b { String::new() } else { format!(", {}", plain(b)) };
            (format!("{name}({}{second})", plain(a)), Binding::Atom)
        }
        Node::Select(comparison, [a, b, c, d]) => {
            let sign = match comparison {
                Comparison::Less => "<",
                Comparison::LessOrEqual => "<=",
                Comparison::Equal => "==",
            };
            let (a, b) = (within(a, Binding::Sum), within(b, Binding::Sum));
            (format!("if {a} {sign} {b} then {} else {}", within(c, Binding::Sum), plain(d)), Binding::Condition)
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
