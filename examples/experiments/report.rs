//! What an experiment hands over: tables, claims beside what came out, and figures.

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
    pub name: String,
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
        x: &'static str,
        y: &'static str,
        series: Vec<(String, Vec<(f64, f64)>)>,
    ) {
        self.figures.push(Figure { name: name.into(), x, y, series });
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n{}\n{}", self.title, "=".repeat(self.title.chars().count()))?;
        for table in &self.tables {
            let first = table.rows.iter().map(|(label, _)| label.chars().count()).max().unwrap_or(0);
            write!(f, "\n{}\n{:first$}", table.title, "")?;
            for column in &table.columns {
                write!(f, " {column:>11}")?;
            }
            writeln!(f)?;
            for (label, cells) in &table.rows {
                write!(f, "{label:first$}")?;
                for cell in cells {
                    write!(f, " {cell:>11.3}")?;
                }
                writeln!(f)?;
            }
        }
        writeln!(f)?;
        for claim in &self.claims {
            let verdict = if claim.holds { "holds" } else { "FAILS" };
            writeln!(f, "[{verdict}] {}\n        here: {}", claim.statement, claim.found)?;
        }
        Ok(())
    }
}

impl Figure {
    /// Draws the figure as `name.svg` into a folder.
    pub fn draw(&self, folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
        let points =
            || self.series.iter().flat_map(|(_, points)| points).filter(|p| p.0.is_finite() && p.1.is_finite());
        let span = |of: fn(&(f64, f64)) -> f64| {
            let (low, high) = points().map(of).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            let pad = 0.04 * (high - low).max(1e-9);
            low - pad..high + pad
        };
        let path = folder.join(format!("{}.svg", self.name));
        let root = SVGBackend::new(&path, (800, 480)).into_drawing_area();
        root.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.name, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(40)
            .y_label_area_size(64)
            .build_cartesian_2d(span(|p| p.0), span(|p| p.1))?;
        chart.configure_mesh().x_desc(self.x).y_desc(self.y).light_line_style(WHITE).draw()?;
        for (i, (label, points)) in self.series.iter().enumerate() {
            let color = Palette99::pick(i).to_rgba();
            chart
                .draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(2)))?
                .label(label)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
        }
        chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
        root.present()?;
        Ok(())
    }
}

/// Every n-th of a long series, so that about 1,500 points are left.
pub fn thin(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let step = points.len().div_ceil(1500).max(1);
    points.into_iter().step_by(step).collect()
}
