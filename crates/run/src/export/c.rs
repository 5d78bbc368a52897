//! One step as C: a file that is included, in C99 and in C++11 as well. It allocates nothing and has no globals that change.

use std::fmt::Write as _;

use super::{Member, OneStep};

/// Most numbers in a line.
const IN_A_LINE: usize = 6;

/// The program in the comment at the top. Where there is no variance, `without_variance` takes it out.
const EXAMPLE: &str = r##"#include <stdio.h>
#include "network.h"

int main(void)
{
    scrnn_state state;
    double sample[SCRNN_CHANNELS], mean[SCRNN_CHANNELS], variance[SCRNN_CHANNELS];
    int i;

    scrnn_start(&state);
    for (;;) {
        for (i = 0; i < SCRNN_CHANNELS; ++i)
            if (scanf("%lf", &sample[i]) != 1)
                return 0;
        scrnn_step(&state, sample, mean, variance);
        for (i = 0; i < SCRNN_CHANNELS; ++i)
            printf("%s: %.17g %.17g\n", scrnn_channel(i), mean[i], variance[i]);
    }
}
"##;

fn without_variance(text: &str) -> String {
    text.replace(", variance[SCRNN_CHANNELS]", "")
        .replace(", variance[i]", "")
        .replace(", variance)", ")")
        .replace(" %.17g %.17g", " %.17g")
}

impl OneStep {
    /// The step as the text of a C file.
    #[must_use]
    pub fn c(&self) -> String {
        let mut out = self.heading();
        self.write_sizes(&mut out);
        self.write_numbers(&mut out);
        self.write_state(&mut out);
        self.write_step(&mut out);
        out.push_str("\n#endif\n");
        out
    }

    /// The comment at the top.
    fn heading(&self) -> String {
        let example = match self.kind.variance {
            true => EXAMPLE.to_owned(),
            false => without_variance(EXAMPLE),
        };
        let (and_variance, argument) = if self.kind.variance { (" and the variance", ", variance") } else { ("", "") };
        let mut lines = vec![
            format!("One step of a network that predicts the mean{and_variance} of {}.", self.forecast()),
            format!("Written by scrnn {} from {}.", env!("CARGO_PKG_VERSION"), self.about),
            String::new(),
            "    scrnn_start(&state)             the state before the first sample".to_owned(),
            format!("    scrnn_step(&state, sample, mean{argument})"),
            "                                    takes in a sample, and predicts".to_owned(),
            "    scrnn_channel(i)                the name of channel i, from 0".to_owned(),
            String::new(),
            format!("The state begins from {}.", self.begins),
            "A copy of the state is a network of its own: step it with NAN to look further ahead.".to_owned(),
            String::new(),
            "All numbers are in the units of the data. What is NAN or infinite in a sample is missing: the".to_owned(),
            "network's own prediction stands in for it.".to_owned(),
            "Everything is static: a program with two networks includes each in a source file of its own.".to_owned(),
        ];
        lines.extend(self.period.map(|period| format!("It learned from a sample every {period} s.")));
        lines.extend(self.remark.iter().map(|remark| format!("Its {remark}.")));
        lines.push(String::new());
        lines.push(
            "A program that reads samples and prints predictions, built by cc -std=c99 -O2 program.c -lm:".to_owned(),
        );
        lines.push(String::new());
        let mut out = String::from("/*\n");
        let own = lines.iter().map(|text| in_a_comment(text));
        let shown = example.lines().map(|text| if text.is_empty() { String::new() } else { format!("    {text}") });
        for text in own.chain(shown) {
            let gap = if text.is_empty() { "" } else { " " };
            let _ = writeln!(out, " *{gap}{text}");
        }
        out.push_str(" */\n");
        out
    }

    fn write_sizes(&self, out: &mut String) {
        let past = self.kind.past();
        let sizes = [
            ("CHANNELS", self.channels.len(), "numbers in a sample"),
            ("DELAY", self.kind.delay, "steps from a sample to the one that is predicted from it"),
            ("UNITS", self.kind.units, "context units of a member"),
            ("INPUTS", self.kind.inputs, "numbers that reach the context"),
            ("PAST", past, "inputs before the newest that are kept"),
            ("MEMBERS", self.members.len(), "networks, whose mixture predicts"),
        ];
        out.push_str(GUARD);
        for (name, value, about) in sizes {
            let _ = writeln!(out, "#define {:24} {value:<8} /* {about} */", format!("SCRNN_{name}"));
        }
    }

    /// All constants.
    fn write_numbers(&self, out: &mut String) {
        let (kind, n) = (self.kind, self.channels.len());
        let (units, inputs, lags) = (kind.units, kind.inputs, kind.lags);
        out.push_str("\n/* scaled = (raw - offset) * scale */\n");
        array(out, "offset", &[n], &self.offset);
        array(out, "scale", &[n], &self.scale);
        out.push_str("\n/* The context: 1 - 1/tau; weights and biases divided by tau. Rows are units. */\n");
        self.each(out, "start_internal", &[units], |member| &member.internal);
        self.each(out, "decay", &[units], |member| &member.decay);
        self.each(out, "from_input", &[units, inputs], |member| &member.from_input);
        self.each(out, "from_context", &[units, units], |member| &member.from_context);
        self.each(out, "bias", &[units], |member| &member.bias);
        out.push_str("\n/* The outputs. Rows are channels. */\n");
        self.each(out, "mean_from_context", &[n, units], |member| &member.mean_from_context);
        self.each(out, "mean_bias", &[n], |member| &member.mean_bias);
        if kind.variance {
            self.each(out, "variance_from_context", &[n, units], |member| &member.variance_from_context);
            self.each(out, "variance_bias", &[n], |member| &member.variance_bias);
            let _ = writeln!(out, "static const double scrnn_variance_floor = {};", number(kind.floor));
        }
        if kind.velocity {
            out.push_str("\n/* What the differences of neighbouring inputs are multiplied with. */\n");
            self.each(out, "velocity", &[n], |member| &member.velocity);
        }
        if kind.skip {
            out.push_str("\n/* The skip connection: the size of what it leaves over, what it takes of the last differences. */\n");
            self.each(out, "skip_scale", &[n], |member| &member.skip_scale);
            if lags > 0 {
                self.each(out, "taps", &[lags, n, n], |member| &member.taps);
            }
        }
    }

    /// An array of this shape for each member.
    fn each(&self, out: &mut String, name: &str, shape: &[usize], of: impl Fn(&Member) -> &Vec<f64>) {
        let values: Vec<f64> = self.members.iter().flat_map(|member| of(member).iter().copied()).collect();
        let shape: Vec<usize> = [self.members.len()].iter().chain(shape).copied().collect();
        array(out, name, &shape, &values);
    }

    fn write_state(&self, out: &mut String) {
        out.push_str(
            "\n/* All that goes from step to step. past and means are scaled. */
typedef struct {
    double internal[SCRNN_MEMBERS][SCRNN_UNITS];                    /* u of the context units */
    double past[SCRNN_MEMBERS][SCRNN_PAST + 1][SCRNN_CHANNELS];     /* the last inputs, newest first */
    double means[SCRNN_MEMBERS][SCRNN_DELAY][SCRNN_CHANNELS];       /* of the last steps, oldest first */
    int steps;                                                      /* taken, up to SCRNN_DELAY */
} scrnn_state;

/* The name of a channel, in UTF-8; of one that is not there, an empty text. */
static inline const char *scrnn_channel(int i)
{
    static const char *const names[SCRNN_CHANNELS] = {\n",
        );
        for name in &self.channels {
            let _ = writeln!(out, "        {},", quoted(name));
        }
        out.push_str(
            "    };

    return i >= 0 && i < SCRNN_CHANNELS ? names[i] : \"\";
}

/* The state before the first sample. To begin from another initial state, write it into internal afterwards. */
static inline void scrnn_start(scrnn_state *state)
{
    int i, k, m;

    for (m = 0; m < SCRNN_MEMBERS; ++m) {
        for (i = 0; i < SCRNN_UNITS; ++i)
            state->internal[m][i] = scrnn_start_internal[m][i];
        for (i = 0; i < SCRNN_CHANNELS; ++i) {
            for (k = 0; k <= SCRNN_PAST; ++k)
                state->past[m][k][i] = 0.0;
            for (k = 0; k < SCRNN_DELAY; ++k)
                state->means[m][k][i] = 0.0;
        }
    }
    state->steps = 0;
}
",
        );
    }

    /// The function that takes a step.
    fn write_step(&self, out: &mut String) {
        let (argument, and_variance, into) = match self.kind.variance {
            true => (", double *variance", " and the variance", "two arrays"),
            false => ("", "", "an array"),
        };
        let forecast = self.forecast();
        let _ = write!(
            out,
            "
/*
 * Takes in a sample of SCRNN_CHANNELS numbers. Writes the mean{and_variance} of {forecast}
 * into {into} of as many.
 */
static inline void scrnn_step(scrnn_state *state, const double *sample, double *mean{argument})
{{
    double y[SCRNN_MEMBERS][SCRNN_CHANNELS];
"
        );
        if self.kind.variance {
            out.push_str("    double v[SCRNN_MEMBERS][SCRNN_CHANNELS];\n");
        }
        out.push_str(TAKE_IN);
        if self.kind.past() > 0 {
            out.push_str(MOVE_PAST);
        }
        out.push_str(KEEP_INPUT);
        if self.kind.velocity {
            out.push_str(VELOCITY);
        }
        out.push_str(DYNAMICS);
        self.write_outputs(out);
        out.push_str("\n        /* The newest mean comes last. */\n");
        if self.kind.delay > 1 {
            out.push_str(MOVE_MEANS);
        }
        out.push_str(KEEP_MEAN);
        self.write_moments(out);
        out.push_str("}\n");
    }

    /// y and v of one member.
    fn write_outputs(&self, out: &mut String) {
        let kind = self.kind;
        let rho = if kind.linear_mean { "said" } else { "tanh(said)" };
        let y = if kind.skip { format!("guess + scrnn_skip_scale[m][i] * {rho}") } else { rho.to_owned() };
        out.push_str(
            "\n        for (i = 0; i < SCRNN_CHANNELS; ++i) {\n            double said = scrnn_mean_bias[m][i];\n",
        );
        if kind.skip {
            out.push_str("            double guess = past[0][i];\n");
        }
        if kind.lags > 0 {
            let _ = write!(
                out,
                "            int lag;

            for (lag = 0; lag < {}; ++lag)
                for (j = 0; j < SCRNN_CHANNELS; ++j)
                    guess += scrnn_taps[m][lag][i][j] * (past[lag][j] - past[lag + 1][j]);",
                kind.lags
            );
        }
        let _ = write!(
            out,
            "
            for (j = 0; j < SCRNN_UNITS; ++j)
                said += scrnn_mean_from_context[m][i][j] * c[j];
            y[m][i] = {y};
        }}
"
        );
        if kind.variance {
            let squared = if kind.skip { " * scrnn_skip_scale[m][i] * scrnn_skip_scale[m][i]" } else { "" };
            let _ = write!(
                out,
                "        for (i = 0; i < SCRNN_CHANNELS; ++i) {{
            double said = scrnn_variance_bias[m][i];

            for (j = 0; j < SCRNN_UNITS; ++j)
                said += scrnn_variance_from_context[m][i][j] * c[j];
            v[m][i] = (exp(said) + scrnn_variance_floor){squared};
        }}
"
            );
        }
    }

    /// What the members predict together.
    fn write_moments(&self, out: &mut String) {
        let spread = if self.kind.variance { ", spread = 0.0" } else { "" };
        let _ = write!(
            out,
            "    }}
    if (state->steps < SCRNN_DELAY)
        ++state->steps;

    /* The moments of the mixture, in the units of the data. */
    for (i = 0; i < SCRNN_CHANNELS; ++i) {{
        double sum = 0.0{spread};

        for (m = 0; m < SCRNN_MEMBERS; ++m)
            sum += y[m][i];
        sum /= SCRNN_MEMBERS;
        mean[i] = sum / scrnn_scale[i] + scrnn_offset[i];
"
        );
        if self.kind.variance {
            out.push_str(
                "        for (m = 0; m < SCRNN_MEMBERS; ++m)
            spread += v[m][i] + (y[m][i] - sum) * (y[m][i] - sum);
        variance[i] = spread / SCRNN_MEMBERS / (scrnn_scale[i] * scrnn_scale[i]);
",
            );
        }
        out.push_str("    }\n");
    }
}

const GUARD: &str = r#"#ifndef SCRNN_STEP_H
#define SCRNN_STEP_H

#include <math.h>

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "compile without -ffast-math: it knows no NAN, which says what is missing"
#endif

"#;

// The parts of the step that are the same for all networks that have them.

const TAKE_IN: &str = "    int i, j, m;

    for (m = 0; m < SCRNN_MEMBERS; ++m) {
        double *u = state->internal[m];
        double (*past)[SCRNN_CHANNELS] = state->past[m];
        double (*means)[SCRNN_CHANNELS] = state->means[m];
        double c[SCRNN_UNITS], x[SCRNN_INPUTS];

        /* The sample, scaled; where it is missing, what was predicted for it, or the last input. */
        for (i = 0; i < SCRNN_CHANNELS; ++i) {
            const double scaled = (sample[i] - scrnn_offset[i]) * scrnn_scale[i];

            if (isfinite(scaled))
                x[i] = scaled;
            else
                x[i] = state->steps >= SCRNN_DELAY ? means[0][i] : past[0][i];
        }
";

const MOVE_PAST: &str = "        for (j = SCRNN_PAST; j > 0; --j)
            for (i = 0; i < SCRNN_CHANNELS; ++i)
                past[j][i] = state->steps > 0 ? past[j - 1][i] : x[i];
";

const KEEP_INPUT: &str = "        for (i = 0; i < SCRNN_CHANNELS; ++i)
            past[0][i] = x[i];
";

const VELOCITY: &str = "        for (i = 0; i < SCRNN_CHANNELS; ++i)
            x[SCRNN_CHANNELS + i] = (past[0][i] - past[1][i]) * scrnn_velocity[m][i];
";

const DYNAMICS: &str = "
        /* u <- (1 - 1/tau) u + (1/tau) (W x + W c + b),  c = tanh u */
        for (i = 0; i < SCRNN_UNITS; ++i)
            c[i] = tanh(u[i]);
        for (i = 0; i < SCRNN_UNITS; ++i) {
            double drive = scrnn_bias[m][i];

            for (j = 0; j < SCRNN_INPUTS; ++j)
                drive += scrnn_from_input[m][i][j] * x[j];
            for (j = 0; j < SCRNN_UNITS; ++j)
                drive += scrnn_from_context[m][i][j] * c[j];
            u[i] = scrnn_decay[m][i] * u[i] + drive;
        }
        for (i = 0; i < SCRNN_UNITS; ++i)
            c[i] = tanh(u[i]);
";

const MOVE_MEANS: &str = "        for (j = 0; j + 1 < SCRNN_DELAY; ++j)
            for (i = 0; i < SCRNN_CHANNELS; ++i)
                means[j][i] = means[j + 1][i];
";

const KEEP_MEAN: &str = "        for (i = 0; i < SCRNN_CHANNELS; ++i)
            means[SCRNN_DELAY - 1][i] = y[m][i];
";

fn array(out: &mut String, name: &str, shape: &[usize], values: &[f64]) {
    let _ = write!(out, "static const double scrnn_{name}");
    for size in shape {
        let _ = write!(out, "[{size}]");
    }
    out.push_str(" = ");
    braces(out, shape, values, 0);
    out.push_str(";\n");
}

/// Values of this shape in nested braces.
fn braces(out: &mut String, shape: &[usize], values: &[f64], depth: usize) {
    let indent = "    ".repeat(depth + 1);
    out.push_str("{\n");
    match shape {
        [] | [_] => {
            for line in values.chunks(IN_A_LINE) {
                let numbers: Vec<String> = line.iter().map(|value| number(*value)).collect();
                let _ = writeln!(out, "{indent}{},", numbers.join(", "));
            }
        }
        [rows, inner @ ..] => {
            for row in values.chunks_exact((values.len() / rows.max(&1)).max(1)) {
                out.push_str(&indent);
                braces(out, inner, row, depth + 1);
                out.push_str(",\n");
            }
        }
    }
    let _ = write!(out, "{}}}", "    ".repeat(depth));
}

/// The shortest decimal that is read as this very number.
fn number(value: f64) -> String {
    format!("{value:e}")
}

/// Text as a string of C, whatever bytes are in it. Question marks could be trigraphs.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for byte in text.bytes() {
        match byte {
            b'"' | b'\\' | b'?' => out.extend(['\\', char::from(byte)]),
            b' '..=b'~' => out.push(char::from(byte)),
            _ => {
                let _ = write!(out, "\\{byte:03o}");
            }
        }
    }
    out + "\""
}

/// Text that may stand in a comment: it does not end it, and does not look as if it began another.
fn in_a_comment(text: &str) -> String {
    let plain = |c: char| if matches!(c, ' '..='~') && c != '?' { c } else { '_' };
    text.chars().map(plain).collect::<String>().replace("*/", "*_").replace("/*", "_*")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_neither_end_a_text_nor_a_comment() {
        assert_eq!(quoted("elbow [rad]"), "\"elbow [rad]\"");
        assert_eq!(quoted("a\"b\\c\n\u{fc}7??/"), r#""a\"b\\c\012\303\2747\?\?/""#);
        assert_eq!(in_a_comment("*/ /* ??/ */*/ //* \n\u{fc}"), "*_ _* __/ *_*_ /_* __");
    }

    #[test]
    fn numbers_are_read_as_what_they_are() {
        for value in [0.1, -0.0, 1.0, 5e-324, f64::MAX, -1.0 / 3.0, 1e22, 123_456_789.0] {
            assert_eq!(number(value).parse::<f64>().unwrap().to_bits(), value.to_bits());
            assert!(number(value).contains('e'), "an integer of C: {}", number(value));
        }
    }
}
