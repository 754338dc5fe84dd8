//! Text for a terminal of 80 columns: lines are broken between words only.

use super::Table;
use core::fmt::Write;

/// Columns of a terminal.
pub(crate) const WIDTH: usize = 80;
/// Space between the columns of a table.
const BETWEEN: usize = 2;

/// A text that begins in a column, broken between words before the end of the line; all lines but the first are indented.
/// A word that is longer than a line has one of its own.
pub(crate) fn wrapped(text: &str, begin: usize, indent: usize) -> String {
    let mut lines = String::new();
    let (mut column, mut first) = (begin, true);
    for word in text.split_whitespace() {
        let letters = columns_of(word);
        if !first && column + 1 + letters > WIDTH {
            lines.push('\n');
            lines.extend(core::iter::repeat_n(' ', indent));
            column = indent;
        } else if !first {
            lines.push(' ');
            column += 1;
        }
        lines.push_str(word);
        column += letters;
        first = false;
    }
    lines
}

/// Columns that a text takes, one for each letter.
fn columns_of(text: &str) -> usize {
    text.chars().count()
}

/// Text that moves no cursor: of control characters only that they are there.
pub(crate) fn visible(text: &str) -> String {
    text.chars().map(|letter| if letter.is_control() { '\u{FFFD}' } else { letter }).collect()
}

/// A table: its first column to the left, numbers to the right; where it is too wide, one part of the columns below the
/// other, or, if they are not all numbers, a few lines for each row.
pub(super) fn table(table: &Table) -> String {
    let rows: Vec<Vec<String>> =
        table.rows.iter().map(|row| row.iter().map(|cell| visible(cell.text())).collect()).collect();
    let columns: Vec<String> = table.columns.iter().map(|name| visible(name)).collect();
    let prose = (0..columns.len()).any(|column| table.is_prose(column));
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column)).chain(&columns[column..=column]);
        cells.map(|cell| columns_of(cell)).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns.len()).map(width).collect();
    let whole = widths.iter().sum::<usize>() + BETWEEN * widths.len().saturating_sub(1);
    let mut text = String::new();
    if !prose && whole <= WIDTH {
        [&columns].into_iter().chain(&rows).for_each(|row| line(&mut text, row, &widths));
    } else if table.is_of_numbers() && widths.iter().skip(1).all(|width| widths[0] + BETWEEN + width <= WIDTH) {
        let lines: Vec<&[String]> = [columns.as_slice()].into_iter().chain(rows.iter().map(Vec::as_slice)).collect();
        parts(&mut text, &lines, &widths);
    } else if columns.len() == 2 {
        rows.iter().for_each(|row| entry(&mut text, row, widths[0]));
    } else {
        rows.iter().for_each(|row| card(&mut text, &columns, row));
    }
    if let Some(more) = table.remainder() {
        text += &more;
        text.push('\n');
    }
    text
}

/// The columns part by part, each after the first column again.
fn parts(text: &mut String, lines: &[&[String]], widths: &[usize]) {
    let mut from = 1;
    while from < widths.len() {
        let mut width = widths[0];
        let fits = |column: &&usize| {
            width += BETWEEN + *column;
            width <= WIDTH
        };
        let end = from + widths[from..].iter().take_while(fits).count();
        if from > 1 {
            text.push('\n');
        }
        let part = |of: &[String]| [&of[..1], &of[from.min(of.len())..end.min(of.len())]].concat();
        let widths = [&widths[..1], &widths[from..end]].concat();
        lines.iter().filter(|cells| !cells.is_empty()).for_each(|cells| line(text, &part(cells), &widths));
        from = end;
    }
}

fn line(text: &mut String, cells: &[String], widths: &[usize]) {
    let begin = text.len();
    for (i, (cell, &width)) in cells.iter().zip(widths).enumerate() {
        // Writing to a string does not fail.
        let _ = match i {
            0 => write!(text, "{cell:<width$}"),
            _ => write!(text, "{:BETWEEN$}{cell:>width$}", ""),
        };
    }
    let end = text[begin..].trim_end().len();
    text.truncate(begin + end);
    text.push('\n');
}

/// A row of a name and a text that may take several lines; below the name, where that is long.
fn entry(text: &mut String, cells: &[String], width: usize) {
    let [name, value] = cells else { return };
    let begin = (width + BETWEEN).min(WIDTH / 2);
    // Writing to a string does not fail.
    let _ = if columns_of(name) + BETWEEN > begin {
        writeln!(text, "{}\n    {}", wrapped(name, 0, 2), wrapped(value, 4, 4))
    } else {
        writeln!(text, "{name:<0$}{1}", begin, wrapped(value, begin, begin))
    };
}

/// A row as its name and, below it, its cells with the names of their columns. Each stays on one line, if it fits.
fn card(text: &mut String, columns: &[String], cells: &[String]) {
    let Some((name, cells)) = cells.split_first() else { return };
    text.push_str(&wrapped(name, 0, 2));
    let mut column = WIDTH;
    for (name, cell) in columns.iter().skip(1).zip(cells).filter(|(_, cell)| !cell.is_empty()) {
        let item = format!("{name}: {cell}");
        let letters = columns_of(&item);
        if column + BETWEEN + letters > WIDTH {
            text.push_str("\n    ");
            text.push_str(&wrapped(&item, 4, 6));
            column = 4 + letters;
        } else {
            text.push_str("  ");
            text.push_str(&item);
            column += BETWEEN + letters;
        }
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::super::Cell;
    use super::*;

    fn widest(text: &str) -> usize {
        text.lines().map(columns_of).max().unwrap_or(0)
    }

    #[test]
    fn words_stay_whole() {
        let text = "residuals ".repeat(30) + &"x".repeat(90);
        let lines = wrapped(&text, 4, 6);
        assert!(
            lines.lines().all(|line| line.trim_start().split(' ').all(|word| word == "residuals" || word.len() == 90))
        );
        assert_eq!(lines.lines().filter(|line| columns_of(line) > WIDTH).count(), 1, "the long word alone");
        assert_eq!(lines.lines().next().map(columns_of), Some(69), "seven words from column 4 on");
    }

    /// Numbers stand under each other where they fit, and else below the name of their row.
    #[test]
    fn wide_tables_become_lines() {
        let narrow = Table::new("", ["parameter", "value"]).row(["rs".into(), Cell::number(0.63, 3)]);
        assert_eq!(narrow.to_string(), "parameter  value\nrs          0.63");
        let columns = ["parameter", "value", "standard error", "interval", "unit"];
        let long = "a name of no fewer than thirty letters";
        let wide = Table::new("", columns).row([long.into(), 1u64.into(), 2u64.into(), long.into(), "m".into()]);
        let text = wide.at_most(1).to_string();
        assert!(widest(&text) <= WIDTH && text.contains("value: 1  standard error: 2\n"), "{text}");
        let columns =
            ["cycle", "resistance (ohm)", "inductance (H)", "constant (V s/rad)", "temperature (K)", "load (N m)"];
        let numbers = |k: u64| [Cell::from(k)].into_iter().chain((1..6).map(|i| Cell::number(0.1 * i as f64, 3)));
        let text = Table::new("", columns).rows((0..3).map(numbers)).to_string();
        let expected = "1                   0.1             0.2                 0.3              0.4\n";
        assert!(widest(&text) <= WIDTH && text.contains(expected), "{text}");
        assert!(
            text.ends_with("\n\ncycle  load (N m)\n0             0.5\n1             0.5\n2             0.5"),
            "{text}"
        );
        let text = "why it ended ".repeat(9);
        let two = Table::new("", ["a", "b"]).row([long.repeat(3).as_str().into(), text.as_str().into()]).to_string();
        assert!(widest(&two) <= WIDTH && two.lines().count() == 4, "{two}");
        let rows = (0..9u64).map(|k| ["k".into(), k.into()]);
        assert!(Table::new("", ["name", "k"]).rows(rows).at_most(4).to_string().ends_with("and 5 more"));
    }
}
