//! Segments of a record for filters whose state depends on recent measurements only. Each segment is preceded by a run-in: the last samples of the
//! segment before, run from a guess. The influence of the guess decays there, so that no slopes with respect to the begin of the segment are needed.
//! Whether it has decayed is tested: the segment before has to end where the run-in ends.

use super::batches::{Broken, ends, in_batches};
use super::job::Job;
use super::linearize::{Part, Triangulation, parts};
use super::segments::{Borders, RunIns};
use super::{Objective, Values};
use crate::information::Information;
use crate::optimize::Infeasible;
use crate::sweep::{Piece, Reached, RunError};
use std::ops::Range;

/// A run-in is a quarter of a segment; half of one where a quarter is too short.
const PARTS: [usize; 2] = [4, 2];
/// Two carries are the same where no entry differs by more than this part of its largest magnitude in the record: far less than a step of a search
/// changes. Where a search begins, guesses are simulated, and where it ends, they hardly move, so that they are right to rounding there.
const SAME: f64 = 1e-11;
/// Slopes are the same where none differs by more than this part of the largest one of its column: gradients are as near.
const SAME_SLOPES: f64 = 1e-9;

/// A guess of a covariance is replaced by the constant one where they differ by no more than this part: a step of a search moves it by less.
const NEAR: f64 = 0.1;

/// A record in segments.
struct Segmented<'p> {
    whole: Job<'p>,
    segments: &'p [Range<usize>],
    /// The begin of the record.
    start: Reached,
    /// Where the run-in of each segment but the first begins. The segment that holds it is run in two pieces, before and from there.
    run_ins: Vec<usize>,
}

impl<'p> Segmented<'p> {
    fn new(mut whole: Job<'p>, segments: &'p [Range<usize>], part: usize) -> Self {
        // Slopes in the quantities themselves; a scale of zero marks a column that is left out.
        whole.scales.iter_mut().filter(|scale| **scale != 0.0).for_each(|scale| *scale = 1.0);
        let start = Reached { carry: whole.piece.carry.to_vec(), slopes: whole.piece.slopes.to_vec() };
        let run_ins = segments.windows(2).map(|pair| pair[0].end - pair[0].len() / part).collect();
        Segmented { whole, segments, start, run_ins }
    }

    fn jobs<'s>(&'s self, pieces: impl Iterator<Item = (Range<usize>, &'s Reached)>) -> Vec<Job<'s>> {
        let Job { objective, experiment, seeds, scales, piece } = &self.whole;
        let job = |(samples, from): (Range<usize>, &'s Reached)| {
            let (carry, slopes) = ((&from.carry[..]).into(), (&from.slopes[..]).into());
            let piece = Piece { samples, carry, slopes, ..*piece };
            Job { objective, experiment: *experiment, seeds: seeds.clone(), scales: scales.clone(), piece }
        };
        pieces.map(job).collect()
    }

    /// The run-ins, from guesses.
    fn run_ins<'s>(&'s self, guesses: &'s [Reached]) -> Vec<Job<'s>> {
        let pieces = self.run_ins.iter().zip(self.segments).zip(guesses);
        self.jobs(pieces.map(|((from, segment), guess)| (*from..segment.end, guess)))
    }

    /// The first pieces of the segments, up to the run-in of the next one; the last segment as a whole.
    fn fronts<'s>(&'s self, begins: &'s [Reached]) -> Vec<Job<'s>> {
        let ends = self.run_ins.iter().copied().chain(self.segments.last().map(|last| last.end));
        let pieces = self.segments.iter().zip(ends).zip(std::iter::once(&self.start).chain(begins));
        self.jobs(pieces.map(|((segment, end), begin)| (segment.start..end, begin)))
    }

    /// The second pieces.
    fn backs<'s>(&'s self, fronts: &'s [Part]) -> Vec<Job<'s>> {
        let pieces = self.run_ins.iter().zip(self.segments).zip(fronts);
        self.jobs(pieces.map(|((from, segment), front)| (*from..segment.end, &front.reached)))
    }

    /// Whether each segment ends where the run-in of the next one ended, so that guesses have no influence.
    fn forgets(&self, ends: &[Part], begins: &[Reached]) -> bool {
        let (entries, seeds) = (self.start.carry.len(), self.whole.seeds.len());
        let pairs = || ends.iter().map(|end| &end.reached).zip(begins);
        let all = || std::iter::once(&self.start).chain(begins);
        let largest = |of: &dyn Fn(&Reached) -> f64| all().map(|place| of(place).abs()).fold(0.0, f64::max);
        let sizes: Vec<f64> = (0..entries).map(|i| largest(&|place| place.carry[i])).collect();
        let unit = |i: usize| if sizes[i] > 0.0 { sizes[i] } else { 1.0 };
        let column = |j: usize| {
            let in_units = |i: usize| largest(&|place| place.slopes[i * seeds + j]) / unit(i);
            (0..entries).map(in_units).fold(0.0, f64::max)
        };
        let columns: Vec<f64> = (0..seeds).map(column).collect();
        let same = |i: usize, (end, begin): (&Reached, &Reached)| {
            let close = |j: usize| {
                let difference = end.slopes[i * seeds + j] - begin.slopes[i * seeds + j];
                difference.abs() <= SAME_SLOPES * columns[j] * unit(i)
            };
            (end.carry[i] - begin.carry[i]).abs() <= SAME * sizes[i] && (0..seeds).all(close)
        };
        pairs().all(|pair| (0..entries).all(|i| same(i, pair)))
    }
}

impl Objective<'_> {
    /// Triangles of a filter's likelihood; `None` where no record is cut, where guesses still have an influence after the longest run-in, or where a
    /// piece cannot be evaluated.
    pub(super) fn forgetting(
        &self,
        coordinates: &[f64],
        values: &[Values],
    ) -> Result<Option<Triangulation>, Infeasible> {
        let cuts = &self.problem.cuts;
        if !self.sweep.predicts_variance() || !(0..self.experiments()).any(|e| cuts.is_chained(e)) {
            return Ok(None);
        }
        while let Some(part) = PARTS.get(self.memory.run_in()) {
            match self.after_run_ins(coordinates, values, *part) {
                Ok(Some(found)) => return Ok(Some(found)),
                Ok(None) => self.memory.lengthen_run_in(),
                Err(RunError::Failed { .. }) => break,
                Err(RunError::Stopped) => return Err(Infeasible::Cancelled),
            }
        }
        Ok(None)
    }

    /// Triangles with run-ins of one `part`-th of a segment; `None` where guesses have an influence after them.
    fn after_run_ins(
        &self,
        coordinates: &[f64],
        values: &[Values],
        part: usize,
    ) -> Result<Option<Triangulation>, RunError> {
        let chain =
            |e: usize| Segmented::new(self.job(e, &values[e], coordinates, true), &self.problem.cuts.segments[e], part);
        let chains: Vec<Segmented<'_>> = (0..self.experiments()).map(chain).collect();
        let guesses = self.before_run_ins(coordinates, values, part, &chains)?;
        let begins = of_records(chains.iter().zip(&guesses).map(|(chain, from)| chain.run_ins(from)), |jobs| {
            let lanes = ends(jobs).into_iter().enumerate();
            lanes.map(|(lane, reached)| reached.map_err(|error| Broken { lane, error })).collect()
        })?;
        let fronts = of_records(chains.iter().zip(&begins).map(|(chain, from)| chain.fronts(from)), parts)?;
        let backs = of_records(chains.iter().zip(&fronts).map(|(chain, from)| chain.backs(from)), parts)?;
        if !chains.iter().zip(backs.iter().zip(&begins)).all(|(chain, (ends, begins))| chain.forgets(ends, begins)) {
            return Ok(None);
        }
        let mut found = Triangulation { cost: 0.0, moved: 0.0, by_output: vec![], blocks: vec![], borders: None };
        let mut run_ins = RunIns { part, of: vec![] };
        for (e, (fronts, backs)) in fronts.into_iter().zip(backs).enumerate() {
            let (mut places, mut backs) = (vec![], backs.into_iter());
            let mut whole = Information::new(chains[e].whole.seeds.len());
            for front in fronts {
                found.cost += front.cost;
                whole.merge(&front.triangle);
                if let Some(back) = backs.next() {
                    found.cost += back.cost;
                    whole.merge(&back.triangle);
                    places.push(front.reached);
                }
            }
            whole.scale_columns(&self.problem.unknowns.scales(e, coordinates));
            found.blocks.push(vec![whole]);
            run_ins.of.push(places);
        }
        if !found.cost.is_finite() || found.blocks.iter().flatten().any(|block| !block.is_finite()) {
            return Err(RunError::Failed { sample: 0 });
        }
        let (point, cost, values) = (coordinates.to_vec(), found.cost, values.to_vec());
        found.borders = Some(Borders { point, cost, values, of: begins, right: true, run_ins: Some(run_ins) });
        Ok(Some(found))
    }

    /// Guesses of the carries at the begins of run-ins: those of the best point before, moved along their slopes; at the first point simulated, with
    /// slopes of zero.
    fn before_run_ins(
        &self,
        coordinates: &[f64],
        values: &[Values],
        part: usize,
        chains: &[Segmented<'_>],
    ) -> Result<Vec<Vec<Reached>>, RunError> {
        let mut guesses = self.guessed_before_run_ins(coordinates, values, part, chains)?;
        for (chain, guesses) in chains.iter().zip(&mut guesses) {
            let Job { seeds, piece, .. } = &chain.whole;
            let begins = chain.run_ins.iter().zip(chain.segments).zip(guesses);
            // Where a measurement is missing before, the guess is nearer than the constant covariance.
            let complete = |(sample, segment): (&usize, &Range<usize>)| {
                !piece.prepared.misses(piece.record, segment.start..*sample)
            };
            for ((sample, _), guess) in begins.filter(|((sample, segment), _)| complete((sample, segment))) {
                if let Some(settled) = self.sweep.settled(piece, seeds, *sample, &guess.carry, NEAR) {
                    let (states, all) = (guess.carry.len() - settled.carry.len(), seeds.len());
                    guess.carry[states..].copy_from_slice(&settled.carry);
                    guess.slopes[states * all..].copy_from_slice(&settled.slopes);
                }
            }
        }
        Ok(guesses)
    }

    fn guessed_before_run_ins(
        &self,
        coordinates: &[f64],
        values: &[Values],
        part: usize,
        chains: &[Segmented<'_>],
    ) -> Result<Vec<Vec<Reached>>, RunError> {
        let known = self.memory.at(coordinates).or_else(|| self.memory.best());
        if let Some(from) = known
            && let Some(run_ins) = from.run_ins.as_ref().filter(|run_ins| run_ins.part == part)
        {
            let moved = |(e, places): (usize, &Vec<Reached>)| {
                let change = self.change(e, values, &from);
                places.iter().map(|place| place.moved(&change)).collect()
            };
            return Ok(run_ins.of.iter().enumerate().map(moved).collect());
        }
        let simulated = |chain: &Segmented<'_>| {
            if chain.run_ins.is_empty() {
                return Ok(vec![]);
            }
            let slopes = || vec![0.0; chain.start.slopes.len()];
            let found = self.sweep.follow(&chain.whole.piece, &chain.run_ins)?;
            Ok(found.into_iter().map(|carry| Reached { carry, slopes: slopes() }).collect())
        };
        chains.iter().map(simulated).collect()
    }
}

/// Runs jobs of each record, and returns what comes of them by records.
fn of_records<'j, T: Send>(
    jobs: impl Iterator<Item = Vec<Job<'j>>>,
    batch: impl Fn(&[&Job<'_>]) -> Result<Vec<T>, Broken> + Sync,
) -> Result<Vec<Vec<T>>, RunError> {
    let mut counts = vec![];
    let jobs: Vec<Job<'_>> = jobs.inspect(|jobs| counts.push(jobs.len())).flatten().collect();
    let mut found = in_batches(&jobs, |_, jobs| batch(jobs)).map_err(|(_, error)| error)?.into_iter();
    Ok(counts.into_iter().map(|count| found.by_ref().take(count).collect()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::Control;
    use crate::tests::{Current, Voltage};
    use crate::{Experiment, ExperimentOf, Fit, Kalman, Model, Scalar, Time, fixed, free, signals};

    signals! {
        struct Motion { x: "m", v: "m/s" }
        struct Spring { k: "N/m", c: "N/m^3", q: "1", r: "1" }
    }

    /// A mass of 1 kg at a spring that hardens, with a damper of .5 N s/m.
    #[derive(Clone)]
    struct Mass;

    impl Model for Mass {
        type State = Motion;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Spring;

        fn derivative<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Voltage<S>, p: &Spring<S>) -> Motion<S> {
            Motion { x: x.v, v: u.u - p.k * x.x - p.c * x.x * x.x * x.x - x.v * 0.5 }
        }
        fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Voltage<S>, _p: &Spring<S>) -> Current<S> {
            Current { i: x.x }
        }
        fn diffusion<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Voltage<S>, p: &Spring<S>) -> Motion<S> {
            Motion { x: S::from(0.0), v: p.q }
        }
        fn noise<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Voltage<S>, p: &Spring<S>) -> Current<S> {
            Current { i: p.r }
        }
    }

    /// Measurements that follow no model; every seventh is missing.
    fn record(samples: usize, x: crate::Parameter) -> ExperimentOf<Mass> {
        record_without(samples, x, 0..0)
    }

    /// Such a record without measurements in a stretch.
    fn record_without(samples: usize, x: crate::Parameter, unmeasured: Range<usize>) -> ExperimentOf<Mass> {
        let inputs: Vec<Voltage> = (0..samples).map(|k| Voltage { u: f64::from(k as u32 / 50 % 3) - 0.8 }).collect();
        let measured = |k: usize| {
            if k % 7 == 3 || unmeasured.contains(&k) {
                f64::NAN
            } else {
                (k as f64 * 0.037).sin() + (k * 37 % 21) as f64 * 0.01
            }
        };
        let outputs = (0..samples).map(|k| Current { i: measured(k) }).collect();
        let record = Experiment::new(&Mass, Time::Uniform { start: 0.0, step: 0.1 }, inputs, outputs).unwrap();
        record.initial(Motion { x, v: fixed(0.1) })
    }

    /// The rows of triangles, each with a diagonal that is not negative.
    fn rows(found: &Triangulation) -> Vec<f64> {
        let of = |block: &Information| {
            let last = block.columns();
            let row = |i: usize| (i..=last).map(move |j| block.at(i, j) * block.at(i, i).signum()).collect::<Vec<_>>();
            (0..=last).flat_map(row).collect::<Vec<_>>()
        };
        found.blocks.iter().flatten().flat_map(of).collect()
    }

    /// Cost and triangles are those of segments with slopes with respect to their begins, as near as run-ins are tested for; at the first point the
    /// cost is right to rounding of 3,000 terms. A second point begins from what the first one tells. One of the two records is not cut.
    #[test]
    fn run_ins_change_nothing() {
        let records = [record(3_000, free(0.2)), record(400, free(0.1))];
        let start = Spring { k: free(1.0), c: free(0.3), q: free(0.3).log(), r: free(0.1).log() };
        let problem = Fit::new(&Mass, &records).parameters(start).predictor(Kalman).problem().unwrap();
        let objective = problem.in_units(&Control::NEVER);
        for (moved, rounding) in [(0.0, 1e-13), (0.01, SAME)] {
            let x: Vec<f64> = objective.start().iter().map(|x| x + moved).collect();
            let values = objective.values(&x);
            let found = objective.forgetting(&x, &values).unwrap().unwrap();
            assert!(objective.memory.run_in() < PARTS.len());
            let right = problem.in_units(&Control::NEVER).chaining(&x, &values).unwrap();
            assert!((found.cost / right.cost - 1.0).abs() < rounding, "{} {}", found.cost, right.cost);
            let (found_rows, right) = (rows(&found), rows(&right));
            let largest = right.iter().fold(0.0, |most: f64, entry| most.max(entry.abs()));
            for (found, right) in found_rows.iter().zip(&right) {
                assert!((found - right).abs() < SAME_SLOPES * largest, "{found} {right}");
            }
            objective.memory.keep(std::sync::Arc::new(found.borders.unwrap()));
        }
    }

    /// A filter with hardly any process noise weighs all measurements alike, and one without measurements over two segments follows its begin there:
    /// guesses keep their influence, which is found, and the longer run-in is tried before the segments are chained. The likelihood is that of
    /// dual numbers, which run the record as a whole, to rounding.
    #[test]
    fn guesses_that_keep_their_influence_are_found() {
        let without_process_noise = Spring { k: free(1.0), c: free(0.3), q: fixed(1e-9), r: free(0.1).log() };
        let disturbed = Spring { q: free(0.3).log(), ..without_process_noise };
        for (start, unmeasured) in [(without_process_noise, 0..0), (disturbed, 400..700)] {
            let records = [record_without(1_000, free(0.2), unmeasured)];
            let problem = Fit::new(&Mass, &records).parameters(start).predictor(Kalman).problem().unwrap();
            let objective = problem.in_units(&Control::NEVER);
            let x = objective.start();
            assert!(objective.forgetting(&x, &objective.values(&x)).unwrap().is_none());
            assert_eq!(objective.memory.run_in(), PARTS.len());
            let (chained, whole) = (objective.evaluate(&x).unwrap().cost, objective.cost_at(&x).unwrap());
            assert!((chained / whole - 1.0).abs() < 1e-13, "{chained} {whole}");
        }
    }
}
