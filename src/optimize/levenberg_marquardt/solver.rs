//! The search as a solver of argmin.

use super::LevenbergMarquardt;
use crate::optimize::point::Point;
use crate::optimize::{LeastSquares, LeastSquaresState, machine};
use crate::scaling::Scaling;
use argmin::core::{Error, KV, Problem, Solver, TerminationStatus};

machine::solver!([S: Scaling] LevenbergMarquardt<S>, "Levenberg-Marquardt", |search| {
    let cosine = search.point.as_ref().map_or(0.0, Point::cosine);
    argmin::kv!("lambda" => search.descent.lambda(); "gradient" => cosine;)
});
