//! Which ascent is meant by what was said of it, be it at the command line or in Python.

use scrnn::error_regression::{Ascent, ErrorRegressionOptions};

/// The momentum ascent's rate for one channel: divided by their number it is the one that the thesis' chapter 5 has.
const THESIS_RATE: f64 = 1e-4;

/// A rule of ascent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// Gradient ascent with momentum, as in the thesis.
    Momentum,
    /// Adam.
    Adam,
    /// L-BFGS.
    Lbfgs,
}

impl Rule {
    const ALL: [Self; 3] = [Self::Lbfgs, Self::Adam, Self::Momentum];

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Momentum => "momentum",
            Self::Adam => "adam",
            Self::Lbfgs => "lbfgs",
        }
    }

    /// The rule of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rule| rule.name() == name)
    }
}

/// What was said of the ascent. A rate or a longest gradient alone means Adam, and a momentum alone the rule of that name.
#[derive(Debug, Clone, Copy, Default)]
pub struct Wanted {
    /// The rule.
    pub rule: Option<Rule>,
    /// alpha_reg.
    pub rate: Option<f64>,
    /// eta.
    pub momentum: Option<f64>,
    /// Longest gradient; 0 leaves it as it is.
    pub max_norm: Option<f64>,
    /// Steps for each sample; by default as many as suit the rule.
    pub iterations: Option<usize>,
}

/// Two things that do not go together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conflict {
    /// A field of [`Wanted`].
    pub what: &'static str,
    /// The rule that does not know it.
    pub rule: Rule,
}

impl Wanted {
    /// Changes the ascent of `options`, which is that of whoever says nothing.
    ///
    /// # Errors
    /// A [`Conflict`].
    pub fn change(self, options: &mut ErrorRegressionOptions) -> Result<(), Conflict> {
        let Self { rule, rate, momentum, max_norm, iterations } = self;
        let has_rate = rate.is_some() || max_norm.is_some();
        let rule = match rule {
            None if momentum.is_some() => Some(Rule::Momentum),
            None if has_rate && matches!(options.ascent, Ascent::Lbfgs { .. }) => Some(Rule::Adam),
            given => given,
        };
        let refuse = |what, rule| Err(Conflict { what, rule });
        match rule {
            Some(rule @ (Rule::Adam | Rule::Lbfgs)) if momentum.is_some() => return refuse("momentum", rule),
            Some(Rule::Lbfgs) if rate.is_some() => return refuse("rate", Rule::Lbfgs),
            Some(Rule::Lbfgs) if max_norm.is_some() => return refuse("max_norm", Rule::Lbfgs),
            Some(Rule::Momentum) => {
                let (momentum, channels) = (momentum.unwrap_or(0.9), options.mask.len());
                options.ascent = Ascent::Momentum { rate: THESIS_RATE / channels as f64, momentum };
            }
            Some(Rule::Adam) => options.ascent = ErrorRegressionOptions::adam(0).ascent,
            Some(Rule::Lbfgs) => options.ascent = ErrorRegressionOptions::new(0).ascent,
            None => {}
        }
        match (iterations, rule) {
            (Some(given), _) => options.iterations = given,
            (None, Some(Rule::Lbfgs)) => options.iterations = ErrorRegressionOptions::new(0).iterations,
            (None, Some(Rule::Adam | Rule::Momentum)) => {
                options.iterations = ErrorRegressionOptions::adam(0).iterations
            }
            (None, None) => {}
        }
        if let Some(rate) = rate {
            options.ascent = options.ascent.with_rate(rate);
        }
        if let Some(norm) = max_norm {
            options.max_norm = Some(norm).filter(|norm| *norm != 0.0);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(wanted: Wanted) -> Result<Ascent, Conflict> {
        let mut options = ErrorRegressionOptions::new(4);
        wanted.change(&mut options).map(|()| options.ascent)
    }

    #[test]
    fn each_rule_has_its_own_number_of_steps_unless_one_is_given() {
        let all = Wanted::default();
        let rule = |rule| Wanted { rule: Some(rule), ..all };
        for default in [ErrorRegressionOptions::new(4), ErrorRegressionOptions::adam(4)] {
            let steps = |wanted: Wanted| {
                let mut options = default.clone();
                wanted.change(&mut options).unwrap();
                options.iterations
            };
            assert_eq!(steps(all), default.iterations);
            assert_eq!([Rule::Lbfgs, Rule::Adam, Rule::Momentum].map(|one| steps(rule(one))), [15, 10, 10]);
            assert_eq!(steps(Wanted { rate: Some(0.1), ..all }), 10);
            assert_eq!(steps(Wanted { momentum: Some(0.5), ..all }), 10);
            assert_eq!(steps(Wanted { iterations: Some(3), ..rule(Rule::Lbfgs) }), 3);
            assert_eq!(steps(Wanted { iterations: Some(0), ..all }), 0);
        }
    }

    #[test]
    fn what_is_said_names_the_rule_or_is_refused() {
        let all = Wanted::default();
        assert_eq!(chosen(all).unwrap(), ErrorRegressionOptions::new(4).ascent);
        assert_eq!(chosen(Wanted { rate: Some(0.02), ..all }).unwrap(), Ascent::Adam { rate: 0.02 });
        assert_eq!(chosen(Wanted { max_norm: Some(0.0), ..all }).unwrap(), Ascent::Adam { rate: 0.05 });
        let momentum = Ascent::Momentum { rate: THESIS_RATE / 4.0, momentum: 0.5 };
        assert_eq!(chosen(Wanted { momentum: Some(0.5), ..all }).unwrap(), momentum);
        for (wanted, what, rule) in [
            (Wanted { rule: Some(Rule::Adam), momentum: Some(0.5), ..all }, "momentum", Rule::Adam),
            (Wanted { rule: Some(Rule::Lbfgs), momentum: Some(0.5), ..all }, "momentum", Rule::Lbfgs),
            (Wanted { rule: Some(Rule::Lbfgs), rate: Some(0.1), ..all }, "rate", Rule::Lbfgs),
            (Wanted { rule: Some(Rule::Lbfgs), max_norm: Some(0.1), ..all }, "max_norm", Rule::Lbfgs),
        ] {
            assert_eq!(chosen(wanted).unwrap_err(), Conflict { what, rule });
        }
        // Where Adam is the default, a rate is a rate of it.
        let mut options = ErrorRegressionOptions::adam(4);
        Wanted { rate: Some(0.02), ..all }.change(&mut options).unwrap();
        assert_eq!(options.ascent, Ascent::Adam { rate: 0.02 });
        assert_eq!(options.iterations, 10);
        assert_eq!(
            ["lbfgs", "adam", "momentum"].map(|name| Rule::named(name).unwrap().name()),
            ["lbfgs", "adam", "momentum"]
        );
        assert_eq!(Rule::named("sgd"), None);
    }
}
