//! Declarations and choices of a fit by names that are known at run time.

use super::fittable::Made;
use super::{Fit, Records};
use crate::error::{Error, find};
use crate::integrate::{Discrete, Esdirk, Rk4, Rk45};
use crate::layout::Quantity;
use crate::loss::{Cauchy, Huber, SoftL1, Tukey};
use crate::optimize::{GaussNewton, LevenbergMarquardt};
use crate::parameter::Parameter;
use crate::predict::{FreeRun, Horizon, InitialCovariance, Kalman, SecondOrder};
use crate::prefilter::Butterworth;
use crate::problem::Noise;
use crate::scaling::{JacobianColumns, OwnSize, Unscaled};

impl<'a, M: Made> Records<'a, M> {
    /// Declares each parameter by its name, in any order.
    ///
    /// # Errors
    /// A name that the model does not have, one that stands twice, a parameter that is left out.
    pub fn parameters_by_name<'n>(
        self,
        parameters: impl IntoIterator<Item = (&'n str, Parameter)>,
    ) -> Result<Fit<'a, M>, Error> {
        let layout = self.model.layout();
        let given: Vec<(&str, Parameter)> = parameters.into_iter().collect();
        Ok(self.declared(in_order("parameter", &layout.parameters, &given)?))
    }
}

impl<M: Made> Fit<'_, M> {
    /// Declares one parameter anew.
    ///
    /// # Errors
    /// A name that the model does not have.
    pub fn parameter(mut self, name: &str, parameter: Parameter) -> Result<Self, Error> {
        let j = position("parameter", &self.model.layout().parameters, name)?;
        if let Some(declared) = self.parameters.get_mut(j) {
            *declared = parameter;
        }
        Ok(self)
    }

    /// The declared parameters, in the order of the layout.
    pub fn declarations(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Whether the predictor is a filter.
    #[cfg(feature = "text")]
    pub(crate) fn filters(&self) -> bool {
        self.predictor.as_ref().is_some_and(super::fittable::Predicting::is_filter)
    }

    /// As [`noise`](Fit::noise), by the names of the outputs, in any order. Of outputs that are left out it is estimated.
    ///
    /// # Errors
    /// A name that the model does not have, one that stands twice.
    pub fn noise_by_name<'n>(self, sigma: impl IntoIterator<Item = (&'n str, f64)>) -> Result<Self, Error> {
        let given: Vec<(&str, f64)> = sigma.into_iter().collect();
        let sigma = entries("output", &self.model.layout().outputs, &given)?;
        Ok(self.noise_of_some(sigma))
    }

    /// As [`noise`](Fit::noise), of the outputs for which there is one, in the order of the layout; of the others it is estimated.
    pub(crate) fn noise_of_some(self, sigma: Vec<Option<f64>>) -> Self {
        let all: Option<Vec<f64>> = sigma.iter().copied().collect();
        self.set(|settings| {
            settings.noise = match all {
                Some(all) => Noise::Given(all),
                None if sigma.iter().all(Option::is_none) => Noise::PerOutput,
                None => Noise::SomeGiven(sigma),
            }
        })
    }

    /// As [`input_noise`](Fit::input_noise), by the names of the inputs; those that are left out have none.
    ///
    /// # Errors
    /// A name that the model does not have.
    pub fn input_noise_by_name<'n>(self, sigma: impl IntoIterator<Item = (&'n str, f64)>) -> Result<Self, Error> {
        let layout = self.model.layout();
        let mut all = vec![0.0; layout.inputs.len()];
        for (name, sigma) in sigma {
            all[position("input", &layout.inputs, name)?] = sigma;
        }
        Ok(self.set(|settings| settings.input_noise = Some(all)))
    }

    /// Sets the loss by its name, with its tuning constant after a colon, if it is not the default: `squared`, `huber`,
    /// `soft-l1`, `cauchy`, `tukey:6`.
    ///
    /// # Errors
    /// A name that is none of these, what is not a number.
    pub fn loss_by_name(self, text: &str) -> Result<Self, Error> {
        let (name, [constant]) = options("loss", text)?;
        Ok(match find("loss", &["squared", "huber", "soft-l1", "cauchy", "tukey"], name)? {
            0 => self.set(|settings| settings.loss = None),
            1 => self.loss(constant.map_or_else(Huber::default, Huber)),
            2 => self.loss(constant.map_or_else(SoftL1::default, SoftL1)),
            3 => self.loss(constant.map_or_else(Cauchy::default, Cauchy)),
            _ => self.loss(constant.map_or_else(Tukey::default, Tukey)),
        })
    }

    /// Sets the predictor by its name: `simulation`, `horizon:5` (samples), `kalman` or `second-order`, the last two with the
    /// [`InitialCovariance`] after a colon, if it is not the default: `kalman:stationary`, `kalman:first-interval`.
    ///
    /// # Errors
    /// A name that is none of these, a horizon that is not a whole number of samples.
    pub fn predictor_by_name(self, text: &str) -> Result<Self, Error> {
        let name = text.split_once(':').map_or(text, |(name, _)| name).trim();
        let predictor = find("predictor", &["simulation", "horizon", "kalman", "second-order"], name)?;
        if predictor < 2 {
            let (_, [steps]) = options("predictor", text)?;
            return Ok(match predictor {
                0 => self.predictor(FreeRun),
                _ => self.predictor(Horizon::new(whole("predictor `horizon`", steps.unwrap_or(f64::NAN))? as usize)),
            });
        }
        let initial = text.split_once(':').map_or("declared", |(_, initial)| initial.trim());
        let initial = match find("initial covariance", &["declared", "stationary", "first-interval"], initial)? {
            0 => InitialCovariance::Declared,
            1 => InitialCovariance::Stationary,
            _ => InitialCovariance::FirstInterval,
        };
        Ok(match predictor {
            2 => self.predictor(Kalman::starting(initial)),
            _ => self.predictor(SecondOrder::starting(initial)),
        })
    }

    /// Sets the integrator by its name: `automatic` (the default), `rk4:4` (steps per sample), `rk45:1e-8` and `esdirk:1e-8`
    /// (relative tolerance), `discrete`.
    ///
    /// # Errors
    /// A name that is none of these, what is not a number.
    pub fn integrator_by_name(self, text: &str) -> Result<Self, Error> {
        let (name, [number]) = options("integrator", text)?;
        Ok(match find("integrator", &["automatic", "rk4", "rk45", "esdirk", "discrete"], name)? {
            0 => Fit { stepping: None, ..self },
            1 => self.integrator(Rk4 { substeps: whole("integrator `rk4`", number.unwrap_or(1.0))? }),
            2 => self.integrator(number.map_or_else(Rk45::default, |relative| Rk45 { relative, ..Rk45::default() })),
            3 => self
                .integrator(number.map_or_else(Esdirk::default, |relative| Esdirk { relative, ..Esdirk::default() })),
            _ => self.integrator(Discrete),
        })
    }

    /// Sets the search by its name: `levenberg-marquardt`, with `own-size` (the default), `jacobian-columns` or `unscaled` for
    /// the scaling after a colon, or `gauss-newton`.
    ///
    /// # Errors
    /// A name that is none of these.
    pub fn optimizer_by_name(self, text: &str) -> Result<Self, Error> {
        let (name, scaling) = text.split_once(':').unwrap_or((text, "own-size"));
        if find("optimizer", &["levenberg-marquardt", "gauss-newton"], name)? == 1 {
            return Ok(self.optimizer(GaussNewton::default()));
        }
        let stop = <LevenbergMarquardt>::default().stop;
        Ok(match find("scaling", &["own-size", "jacobian-columns", "unscaled"], scaling)? {
            0 => self.optimizer(LevenbergMarquardt::new(stop, OwnSize)),
            1 => self.optimizer(LevenbergMarquardt::new(stop, JacobianColumns)),
            _ => self.optimizer(LevenbergMarquardt::new(stop, Unscaled)),
        })
    }

    /// Sets the pre-filter by its name, order and cut-off (Hz): `low-pass:4,100`, `high-pass:2,0.5`, for the sample time of the
    /// fit's records, or, of a fleet, for one that follows (s): `low-pass:4,100,1e-3`.
    ///
    /// # Errors
    /// A name that is none of these, what is not a number, a filter that cannot be made, a sample time that is not known.
    pub fn prefilter_by_name(self, text: &str) -> Result<Self, Error> {
        let (name, [order, cutoff, time]) = options("pre-filter", text)?;
        let pass = find("pre-filter", &["low-pass", "high-pass"], name)?;
        let time = time.or_else(|| self.records.first().map(|record| record.sample_time())).ok_or_else(|| {
            Error::Option(format!("pre-filter `{text}`: no sample time is known; write it as a third number (s)"))
        })?;
        let order = whole("pre-filter's order", order.unwrap_or(f64::NAN))?;
        let make = if pass == 0 { Butterworth::low_pass } else { Butterworth::high_pass };
        Ok(self.prefilter(make(order, cutoff.unwrap_or(f64::NAN), time)?))
    }
}

/// A name and the numbers after its colon, at most so many.
fn options<'t, const N: usize>(what: &str, text: &'t str) -> Result<(&'t str, [Option<f64>; N]), Error> {
    let (name, rest) = text.split_once(':').unwrap_or((text, ""));
    let mut numbers = [None; N];
    let mut parts = rest.split(',').map(str::trim).filter(|part| !part.is_empty());
    for number in &mut numbers {
        let Some(part) = parts.next() else { break };
        let parsed = part.parse::<f64>();
        *number = Some(parsed.map_err(|_| Error::Option(format!("{what} `{text}`: `{part}` is not a number")))?);
    }
    match parts.next() {
        None => Ok((name.trim(), numbers)),
        Some(part) => Err(Error::Option(format!("{what} `{text}`: `{part}` is one number too many"))),
    }
}

/// A whole number from one on.
fn whole(what: &str, number: f64) -> Result<u32, Error> {
    match number {
        number if number.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&number) => Ok(number as u32),
        number => Err(Error::Option(format!("{what}: {number} is not a whole number from 1 on"))),
    }
}

/// Where a quantity stands.
fn position(role: &str, quantities: &[Quantity], name: &str) -> Result<usize, Error> {
    let names: Vec<&str> = quantities.iter().map(|quantity| quantity.name.as_str()).collect();
    find(role, &names, name)
}

/// The entries of the quantities for which there is one, in the order of the quantities.
fn entries<T: Copy>(role: &str, quantities: &[Quantity], given: &[(&str, T)]) -> Result<Vec<Option<T>>, Error> {
    let mut entries: Vec<Option<T>> = vec![None; quantities.len()];
    for (name, entry) in given {
        let j = position(role, quantities, name)?;
        if entries[j].replace(*entry).is_some() {
            return Err(Error::Option(format!("{role} `{name}` is given twice; leave one out")));
        }
    }
    Ok(entries)
}

/// One entry for each quantity, in their order.
fn in_order<T: Copy>(role: &str, quantities: &[Quantity], given: &[(&str, T)]) -> Result<Vec<T>, Error> {
    let entries = entries(role, quantities, given)?;
    let missing = |(quantity, entry): (&Quantity, Option<T>)| {
        entry.ok_or_else(|| {
            Error::Option(format!("{role} `{}` is not given; every {role} needs an entry", quantity.name))
        })
    };
    quantities.iter().zip(entries).map(missing).collect()
}
