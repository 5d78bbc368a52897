//! Experiments with a word on their values, for people to read and change.

use super::Experiment;

/// Why a key has its value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Comment {
    /// The key, with dots. Of groups all have the same: `network.groups.units`.
    pub key: String,
    /// A sentence or two.
    pub text: String,
}

/// Characters in a line of comments.
const WIDTH: usize = 116;

impl Experiment {
    /// The experiment as a file, every comment above its key.
    pub fn to_file(&self) -> String {
        let text = toml::to_string(self).expect("the experiment came from such a file");
        commented(&text, &self.comments)
    }

    /// Whether both say the same, whatever their comments.
    pub fn says_the_same(&self, other: &Self) -> bool {
        let plain = |one: &Self| Self { comments: Vec::new(), ..one.clone() };
        plain(self) == plain(other)
    }
}

/// Puts each comment above the line of its key. A key that stands in several tables of a list gets it once.
fn commented(text: &str, comments: &[Comment]) -> String {
    let mut left: Vec<&Comment> = comments.iter().collect();
    let (mut out, mut table) = (String::new(), String::new());
    for line in text.lines() {
        if line.starts_with('[') {
            table = line.trim_matches(['[', ']']).to_owned() + ".";
        } else if let Some((key, _)) = line.split_once(" = ") {
            let key = format!("{table}{key}");
            if let Some(at) = left.iter().position(|comment| comment.key == key) {
                out += &in_lines(&left.remove(at).text);
            }
        }
        out += line;
        out.push('\n');
    }
    out
}

/// A text as lines of comments.
pub fn in_lines(text: &str) -> String {
    let (mut out, mut line) = (String::new(), String::from("#"));
    // A line break in a name must not end the comment.
    for word in text.split_whitespace() {
        if line.len() > 1 && line.chars().count() + word.chars().count() >= WIDTH {
            out += &line;
            out.push('\n');
            line = String::from("#");
        }
        line.push(' ');
        line.extend(word.chars().map(|c| if c.is_control() { '?' } else { c }));
    }
    out + &line + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_stand_above_their_keys_and_the_file_says_the_same() {
        let text = "name = \"a\"\n[data]\nfiles = [\"a.csv\"]\n[[network.groups]]\nname = \"context\"\nunits = 3\ntime_constant = 2.0\n\
                    [training]\nepochs = 3\noptimiser = \"adam\"\n[training.adam]\nrate = 0.1\n";
        let mut experiment = super::super::read_text("a.toml", text, &[]).unwrap();
        let comment = |key: &str, text: &str| Comment { key: key.to_owned(), text: text.to_owned() };
        experiment.comments =
            vec![comment("network.groups.units", "Few."), comment("training.adam.rate", &"word ".repeat(40))];
        let file = experiment.to_file();
        assert!(file.contains("# Few.\nunits = 3\n"), "{file}");
        let lines: Vec<&str> = file.lines().filter(|line| line.starts_with("# word")).collect();
        assert_eq!(lines.len(), 2);
        assert!(lines.iter().all(|line| line.len() <= WIDTH), "{lines:?}");
        let again = super::super::read_text("b.toml", &file, &[]).unwrap();
        assert!(again.says_the_same(&experiment) && again != experiment);
    }
}
