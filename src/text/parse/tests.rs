//! What texts of expressions are.

use super::*;

/// The whole with all its parentheses.
fn shown(text: &str) -> String {
    let (nodes, _) = parse(text).unwrap_or_else(|wrong| panic!("{text}: {wrong:?}"));
    let mut shown: Vec<String> = vec![];
    for node in &nodes {
        let of = |at: &At| shown[*at].clone();
        let text = match &node.operation {
            Operation::Number(value) => value.to_string(),
            Operation::Name(name) => name.clone(),
            Operation::Negate(a) => format!("(-{})", of(a)),
            Operation::Binary(sign, a, b) => {
                let sign = match sign {
                    Sign::Add => '+',
                    Sign::Sub => '-',
                    Sign::Mul => '*',
                    Sign::Div => '/',
                    Sign::Power => '^',
                };
                format!("({}{sign}{})", of(a), of(b))
            }
            Operation::Call { name, arguments, .. } => {
                format!("{name}({})", arguments.iter().map(of).collect::<Vec<_>>().join(","))
            }
            Operation::If([a, b, c]) => format!("({}?{}:{})", of(a), of(b), of(c)),
            Operation::Compare(relation, a, b) => format!("({}{relation:?}{})", of(a), of(b)),
            Operation::And(a, b) => format!("({}&{})", of(a), of(b)),
            Operation::Or(a, b) => format!("({}|{})", of(a), of(b)),
            Operation::Not(a) => format!("(!{})", of(a)),
        };
        shown.push(text);
    }
    shown.pop().unwrap()
}

#[test]
fn precedence() {
    for (text, expected) in [
        ("1 - 2 - 3", "((1-2)-3)"),
        ("a/b*c", "((a/b)*c)"),
        ("a + b*c", "(a+(b*c))"),
        ("-x^2", "(-(x^2))"),
        ("2^3^2", "(2^(3^2))"),
        ("2^-x^2", "(2^(-(x^2)))"),
        ("-a*b", "((-a)*b)"),
        ("a**2", "(a^2)"),
        ("a - -b", "(a-(-b))"),
        ("+a", "a"),
        ("(a + b)*c", "((a+b)*c)"),
        ("if a < b then 1 else 2 + 3", "((aLessb)?1:(2+3))"),
        ("1 + if a <= b then 1 else if a > c then 2 else 3", "(1+((aLessOrEqualb)?1:((aGreaterc)?2:3)))"),
        ("if not a < b and b >= c or c < 1 then 1 else 0", "((((!(aLessb))&(bGreaterOrEqualc))|(cLess1))?1:0)"),
        ("max(a, b + 1)*f()", "(max(a,(b+1))*f())"),
        ("1e3 + .5 + 2. + 1.5E-2", "(((1000+0.5)+2)+0.015)"),
        ("`speed (rpm)` + µ_1 # a remark\n + 1", "((speed (rpm)+µ_1)+1)"),
    ] {
        assert_eq!(shown(text), expected, "{text}");
    }
}

/// A long sum takes no stack; what nests deeper than the limit is an error, whatever it nests by.
#[test]
fn depth_is_limited() {
    assert!(parse(&vec!["x"; 50_000].join(" + ")).is_ok());
    assert!(parse(&format!("{}x{}", "(".repeat(150), ")".repeat(150))).is_ok());
    for text in [
        format!("{}x{}", "(".repeat(100_000), ")".repeat(100_000)),
        format!("{}x", "-".repeat(100_000)),
        format!("{}x", "if not ".repeat(100_000)),
        vec!["x"; 100_000].join("^"),
        format!("{}1", "if a < b then 1 else ".repeat(100_000)),
        "sin(".repeat(100_000),
    ] {
        assert!(parse(&text).unwrap_err().title.contains("nested more than 200 deep"));
    }
    assert!(parse(&vec!["x"; 150_000].join(" + ")).unwrap_err().title.contains("more than 200000 operations"));
}
