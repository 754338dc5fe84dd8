//! Models for readers: LaTeX and Markdown say all that the text says.

use crate::meaning::model;

/// Names that differ print differently; a letter and an index stand for two letters where nothing else does.
#[test]
fn symbols_differ() {
    let text = "greybox = 1\n[parameters]\nka = { start = 1 }\nk_a = { start = 1 }\nrs = { start = 1 }\n\
                [states]\nx = { derivative = \"k_a*x - ka*x - rs*x\" }\n[outputs]\ny = \"x\"";
    let expected = "\\begin{aligned}\n\
                    \\frac{dx}{dt} &= k_{\\mathrm{a}} \\, x - \\mathit{ka} \\, x - r_{\\mathrm{s}} \\, x \\\\\n\
                    \\hat{y}_{\\mathrm{y}} &= x\n\\end{aligned}\n";
    assert_eq!(model(text).to_latex(), expected);
    let page = model(text).to_markdown();
    assert!(
        page.contains("| $\\mathit{ka}$ | parameter `ka` |")
            && page.contains("| $k_{\\mathrm{a}}$ | parameter `k_a` |")
    );
}

/// Levels of noise and the initial state are equations, too.
#[test]
fn noise_is_printed() {
    let text = "greybox = 1\n[parameters]\na = { start = 1 }\n[states]\n\
                x = { derivative = \"-a*x\", initial = \"2*a\", diffusion = \"0.1*a\", initial_noise = \"3*a\" }\n\
                [outputs]\ny = { value = \"x\", noise = \"0.5\" }";
    let (latex, page) = (model(text).to_latex(), model(text).to_markdown());
    for line in [
        "x(t_0) &= 2 \\, a",
        "\\text{diffusion}\\left(x\\right) &= 0.1 \\, a",
        "\\text{initial noise}\\left(x\\right) &= 3 \\, a",
        "\\text{noise}\\left(\\hat{y}_{\\mathrm{y}}\\right) &= 0.5",
    ] {
        assert!(latex.contains(line) && page.contains(line), "{line} is not in {latex}");
    }
}

/// A table has one form where it is called and listed, its numbers in Markdown; a slope is not the table.
#[test]
fn tables_are_printed() {
    let text = "greybox = 1\n[inputs]\nu = \"\"\n[tables.ocv]\nx = [0, 0.5, 1]\nvalues = [3, 3.7, 4]\noutside = \"linear\"\n\
                [tables.map]\nx = [0, 1]\ny = [-2, 0, 2]\nvalues = [[0, 1, 2], [3, 4, 5]]\noutside = \"hold\"\nmethod = \"smooth\"\n\
                [outputs]\ny = \"ocv(u) + ocv.x(u) + map(u, u)\"";
    let (latex, page) = (model(text).to_latex(), model(text).to_markdown());
    let call = "\\operatorname{ocv}\\left(u\\right) + \\operatorname{ocv}_{x}\\left(u\\right) + \\operatorname{map}\\left(u, u\\right)";
    assert!(latex.contains(call), "{latex}");
    let references = [
        "\\operatorname{ocv} &: \\text{linear table of 3 points from } 0 \\text{ to } 1",
        "\\operatorname{map} &: \\text{smooth table of 2 by 3 points from } 0,\\ -2 \\text{ to } 1,\\ 2",
    ];
    assert!(references.iter().all(|line| latex.contains(line)), "{latex}");
    let curve = "Table `ocv`, linear between its points, a straight line outside:\n\n| x | value |\n|---|---|\n| 0 | 3 |\n| 0.5 | 3.7 |\n| 1 | 4 |\n";
    let surface = "Table `map`, smooth between its points, held outside:\n\n| x | y = -2 | y = 0 | y = 2 |\n|---|---|---|---|\n| 0 | 0 | 1 | 2 |\n";
    assert!(page.contains(curve) && page.contains(surface), "{page}");
    assert!(page.contains("| $\\operatorname{ocv}$ | table `ocv` |"), "{page}");
}
