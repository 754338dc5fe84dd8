//! The search as a solver of argmin.

use super::LevenbergMarquardt;
use crate::optimize::point::Point;
use crate::optimize::{LeastSquares, LeastSquaresState, machine};
use crate::scaling::Scaling;
use argmin::core::{Error, KV, Problem, Solver, TerminationStatus};

impl<O: LeastSquares, S: Scaling> Solver<O, LeastSquaresState> for LevenbergMarquardt<S> {
    fn name(&self) -> &str {
        "Levenberg-Marquardt"
    }

    fn init(
        &mut self,
        problem: &mut Problem<O>,
        state: LeastSquaresState,
    ) -> Result<(LeastSquaresState, Option<KV>), Error> {
        machine::init(self, problem, state)
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<O>,
        state: LeastSquaresState,
    ) -> Result<(LeastSquaresState, Option<KV>), Error> {
        let state = machine::next_iter(self, problem, state)?;
        let cosine = self.point.as_ref().map_or(0.0, Point::cosine);
        Ok((state, Some(argmin::kv!("lambda" => self.descent.lambda(); "gradient" => cosine;))))
    }

    fn terminate(&mut self, _state: &LeastSquaresState) -> TerminationStatus {
        machine::termination(self)
    }
}
