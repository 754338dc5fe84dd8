//! What an experiment hands over: tables, claims beside what came out, and figures.

use greybox::report::{Cell, Table as TextTable};
use plotters::prelude::*;
use serde::Serialize;
use std::fmt;
use std::path::Path;

#[derive(Default, Serialize)]
pub struct Report {
    pub title: String,
    pub tables: Vec<Table>,
    pub claims: Vec<Claim>,
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

#[derive(Serialize)]
pub struct Table {
    pub title: String,
    pub columns: Vec<&'static str>,
    pub rows: Vec<(String, Vec<f64>)>,
}

/// A statement of the source, and what these runs say to it.
#[derive(Serialize)]
pub struct Claim {
    pub statement: &'static str,
    pub found: String,
    pub holds: bool,
}

pub struct Figure {
    /// Of the file.
    pub name: String,
    pub title: String,
    pub x: &'static str,
    pub y: &'static str,
    pub series: Vec<(String, Vec<(f64, f64)>)>,
}

impl Report {
    pub fn new(title: impl Into<String>) -> Self {
        Report { title: title.into(), ..Report::default() }
    }

    pub fn table(&mut self, title: impl Into<String>, columns: &[&'static str], rows: Vec<(String, Vec<f64>)>) {
        self.tables.push(Table { title: title.into(), columns: columns.to_vec(), rows });
    }

    pub fn claim(&mut self, statement: &'static str, found: String, holds: bool) {
        self.claims.push(Claim { statement, found, holds });
    }

    pub fn figure(
        &mut self,
        name: impl Into<String>,
        title: impl Into<String>,
        [x, y]: [&'static str; 2],
        series: Vec<(String, Vec<(f64, f64)>)>,
    ) {
        self.figures.push(Figure { name: name.into(), title: title.into(), x, y, series });
    }
}

/// Text of 80 columns.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n{}\n{}", self.title, "=".repeat(self.title.chars().count()))?;
        for table in &self.tables {
            let number = |value: &f64| {
                // No minus before a zero.
                let value = if value.abs() < 5e-4 { 0.0 } else { *value };
                Cell::Number { value, text: format!("{value:.3}") }
            };
            let rows = table.rows.iter().map(|(label, cells)| {
                [label.as_str().into()].into_iter().chain(cells.iter().map(number)).collect::<Vec<Cell>>()
            });
            let columns = [""].iter().chain(&table.columns).map(|name| (*name).to_owned()).collect();
            writeln!(f, "\n{}\n{}", table.title, TextTable { columns, ..TextTable::new("", []) }.rows(rows))?;
        }
        let verdict = |claim: &Claim| if claim.holds { "holds" } else { "does not hold" };
        let rows = self.claims.iter().flat_map(|claim| {
            [[verdict(claim).into(), claim.statement.into()], ["  here".into(), claim.found.as_str().into()]]
        });
        writeln!(f, "\n{}", TextTable::new("", ["claim", "is"]).rows(rows))
    }
}

/// Told apart by color-blind eyes (Okabe and Ito), and dark enough on white.
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 0, 0),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
];

/// Large enough to be read on a telephone, where the figure is half as wide.
const LETTERS: u32 = 21;

/// Lines that lie on one another are told apart by their widths: those below are wider.
fn stroke(i: usize, count: usize) -> ShapeStyle {
    let width = match count {
        1 | 2 => 2,
        3 | 4 => 2 + 2 * (count - 1 - i),
        _ => 3,
    };
    COLORS[i % COLORS.len()].stroke_width(width as u32)
}

/// A number without zeros behind the point.
fn plainly(value: &f64) -> String {
    format!("{}", (value * 1e6).round() / 1e6)
}

impl Figure {
    /// Draws the figure as `name.svg` into a folder: title, legend, then the data with nothing before them.
    pub fn draw(&self, folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
        let points =
            || self.series.iter().flat_map(|(_, points)| points).filter(|p| p.0.is_finite() && p.1.is_finite());
        let span = |of: fn(&(f64, f64)) -> f64| {
            let (low, high) = points().map(of).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            let pad = 0.04 * (high - low).max(1e-9);
            low - pad..high + pad
        };
        let path = folder.join(format!("{}.svg", self.name));
        let root = SVGBackend::new(&path, (800, 520)).into_drawing_area();
        root.fill(&WHITE)?;
        let letters = ("sans-serif", LETTERS).into_font();
        root.draw(&Text::new(self.title.as_str(), (16, 12), ("sans-serif", 24)))?;
        let (count, mut x, mut y) = (self.series.len(), 16, 50);
        for (i, (label, _)) in self.series.iter().enumerate() {
            let width = 36 + label.chars().count() as i32 * 11 + 20;
            if x + width > 800 && x > 16 {
                (x, y) = (16, y + 26);
            }
            root.draw(&PathElement::new([(x, y + 10), (x + 28, y + 10)], stroke(i, count)))?;
            root.draw(&Text::new(label.as_str(), (x + 36, y), letters.clone()))?;
            x += width;
        }
        let (_, below) = root.split_vertically(y + 30);
        let mut chart = ChartBuilder::on(&below)
            .margin(12)
            .margin_right(24)
            .x_label_area_size(60)
            .y_label_area_size(90)
            .build_cartesian_2d(span(|p| p.0), span(|p| p.1))?;
        chart
            .configure_mesh()
            .x_desc(self.x)
            .y_desc(self.y)
            .x_labels(8)
            .y_labels(7)
            .x_label_formatter(&plainly)
            .y_label_formatter(&plainly)
            .label_style(letters.clone())
            .axis_desc_style(letters)
            .light_line_style(WHITE)
            .draw()?;
        for (i, (_, points)) in self.series.iter().enumerate() {
            chart.draw_series(LineSeries::new(points.iter().copied(), stroke(i, count)))?;
        }
        root.present()?;
        Ok(())
    }
}

/// Every n-th of a long series, so that about 1,500 points are left.
pub fn thin(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let step = points.len().div_ceil(1500).max(1);
    points.into_iter().step_by(step).collect()
}
