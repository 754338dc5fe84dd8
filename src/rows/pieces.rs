//! Parts of the data with steps of their own.

use crate::covariance::directions;
use crate::covariance::point::Point;
use crate::information::Information;
use crate::optimize::Linearization;
use crate::rows::spans::Spans;

/// A record with fewer degrees of freedom than this has the noise of all records.
const OWN: f64 = 30.0;

/// Which rows a piece has.
#[derive(Clone, Copy)]
pub(crate) enum Rows {
    Record(usize),
    Output(usize),
    /// The first parts of each record, so many of them.
    Before(usize),
    After(usize),
}

impl Rows {
    pub fn contain(self, experiment: usize, output: usize, part: usize) -> bool {
        match self {
            Rows::Record(e) => e == experiment,
            Rows::Output(j) => j == output,
            Rows::Before(parts) => part < parts,
            Rows::After(parts) => part >= parts,
        }
    }
}

/// A part of the data: a triangle per experiment, in units of its own noise.
pub(crate) struct Piece {
    pub rows: Rows,
    pub linear: Linearization,
    pub held: Vec<bool>,
    /// By what a step of its own would lower the sum of squares.
    pub gain: f64,
    pub step: Vec<f64>,
    /// How many errors have the information of one.
    pub variance_inflation: f64,
    /// Degrees of freedom of its noise, those of the output that has fewest.
    pub degrees: f64,
}

impl Piece {
    pub fn new(rows: Rows, linear: Linearization, held: &[bool]) -> Option<Self> {
        let held = directions::undetermined(&linear, held).held;
        let step = linear.step(&vec![0.0; held.len()], &held)?;
        let gain = 2.0 * linear.predicted_reduction(&step);
        Some(Piece { rows, linear, held, gain, step, variance_inflation: 1.0, degrees: f64::INFINITY })
    }
}

/// The rows of an output in a piece: a triangle per experiment, and what its own step leaves.
struct OfOutput {
    triangles: Vec<Information>,
    /// Of the squared errors, of their squares, and the number of errors.
    sums: [f64; 3],
    /// The sum of squares without what its own step gains, and its degrees of freedom.
    left: f64,
    degrees: f64,
}

/// The rows of a piece, output by output; `None` where a step of its own is not determined.
fn of_outputs(point: &Point<'_>, all: &[Spans], rows: Rows) -> Option<Vec<OfOutput>> {
    let unknowns = &point.objective.problem.unknowns;
    let mut found = vec![];
    for j in 0..point.objective.outputs() {
        let empty = |e: usize| Information::new(unknowns.columns(e).count());
        let (mut triangles, mut sums): (Vec<_>, _) = ((0..all.len()).map(empty).collect(), [0.0; 3]);
        for (e, parts) in all.iter().enumerate() {
            for (_, part) in parts[j].iter().enumerate().filter(|(number, _)| rows.contain(e, j, *number)) {
                triangles[e].merge(&part.rows);
                sums.iter_mut().zip(part.sums).for_each(|(sum, part)| *sum += part);
            }
        }
        let [squares, _, count] = sums;
        if count == 0.0 {
            continue;
        }
        let linear = Linearization::new(0.0, unknowns.shared(), triangles);
        let own = directions::undetermined(&linear, &point.undetermined.held).held;
        let step = linear.step(&vec![0.0; own.len()], &own)?;
        let free = own.iter().filter(|held| !**held).count() as f64;
        let left = squares - 2.0 * linear.predicted_reduction(&step);
        let triangles = linear.columns().map(|(triangle, _)| triangle.clone()).collect();
        found.push(OfOutput { triangles, sums, left, degrees: count - free });
    }
    Some(found)
}

/// The pieces with these rows, those of each output divided by the noise that is left when its own step is taken; of short records, when
/// all of them have taken theirs.
pub(crate) fn pieces(point: &Point<'_>, all: &[Spans], rows: &[Rows]) -> Vec<Piece> {
    let of = |rows: &Rows| Some((*rows, of_outputs(point, all, *rows)?));
    let found: Vec<(Rows, Vec<OfOutput>)> = rows.iter().filter_map(of).collect();
    let sum = |part: fn(&OfOutput) -> f64| found.iter().flat_map(|(_, of)| of).map(part).sum::<f64>();
    let together = (sum(|of| of.left), sum(|of| of.degrees));
    // Outputs have noise of their own.
    let joined = point.objective.outputs() == 1;
    let one = |(rows, of): &(Rows, Vec<OfOutput>)| {
        let short = |of: &OfOutput| joined && matches!(rows, Rows::Record(_)) && of.degrees < OWN;
        piece(point, *rows, of, |of| if short(of) { together } else { (of.left, of.degrees) })
    };
    found.iter().filter_map(one).collect()
}

/// A piece, with the sum of squares by which its noise is estimated and the degrees of freedom of that.
fn piece(
    point: &Point<'_>,
    rows: Rows,
    outputs: &[OfOutput],
    noise: impl Fn(&OfOutput) -> (f64, f64),
) -> Option<Piece> {
    let predicted = point.objective.sweep.predicts_variance();
    let empty = |triangle: &Information| Information::new(triangle.columns());
    let mut merged: Vec<Information> = outputs.first()?.triangles.iter().map(empty).collect();
    let (mut inflation, mut fewest) = (1.0f64, f64::INFINITY);
    for of in outputs {
        let (left, degrees) = noise(of);
        // Predicted noise levels are among the unknowns.
        let variance = if predicted { 1.0 } else { left / degrees };
        if !(variance > 0.0 && variance.is_finite()) {
            return None;
        }
        fewest = fewest.min(degrees);
        let root = variance.sqrt().recip();
        merged.iter_mut().zip(&of.triangles).for_each(|(all, triangle)| all.merge(&triangle.times(root)));
        if predicted || point.objective.is_weighted() {
            // Squares of errors with heavy tails, or of several sizes, vary more than those of normal ones.
            let [squares, fourths, count] = of.sums;
            inflation = inflation.max(0.5 * (count * fourths / (squares * squares) - 1.0));
        }
    }
    let shared = point.objective.problem.unknowns.shared();
    let piece = Piece::new(rows, Linearization::new(0.0, shared, merged), &point.undetermined.held)?;
    Some(Piece { variance_inflation: inflation, degrees: fewest, ..piece })
}
