//! The triangular form, found in the equations.
//!
//! A chain starts at a measured state. In every *strict* row j the derivative of
//! x_j depends on x_1 … x_{j+1} of the same chain only, and on x_{j+1}; so the
//! next state of a chain is the one new state in the last state's equation, and
//! nothing has to be searched but where two chains are cut.
//!
//! * One output, form (4): rows 1 … n−1 are strict, the last is free.
//! * Two outputs, form (8): a *leading* chain with rows 1 … n₁−1 strict and a
//!   *following* one with rows 1 … n₂−2 strict; row n₂−1 may also depend on the
//!   whole leading chain, and the last rows are free.
//! * More outputs: the same with several following chains, each tied to the leading one.

use crate::{AugmentedPlant, Misfit};

/// Following chains that are tried, in all cuts together.
const TRIED: usize = 100_000;
/// Assignments that are returned.
const MOST: usize = 64;
/// Assignments that a refusal names.
const NAMED: usize = 8;

/// States of one chain x_1, x_2, …, as indices into the augmented states; the first is measured.
pub type Chain = Vec<usize>;

/// An assignment of every augmented state to a chain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Assignment {
    /// one chain per measured output, in their order
    pub chains: Vec<Chain>,
    /// which chain plays the part of the paper's first one (n₁ rows, n₁−1 strict)
    pub leading: usize,
    /// all that can play it
    pub leads: Vec<usize>,
}

impl Assignment {
    /// Lengths of the chains, in the order of the measured outputs.
    pub fn lengths(&self) -> Vec<usize> {
        self.chains.iter().map(Vec::len).collect()
    }
}

/// Difference between the longest and the shortest.
pub(crate) fn imbalance(chains: &[Chain]) -> usize {
    let lengths = || chains.iter().map(Vec::len);
    lengths().max().unwrap_or(0) - lengths().min().unwrap_or(0)
}

/// What the user asks of the assignment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChainRequest {
    /// lengths of the chains, in the order of the measured outputs
    pub lengths: Option<Vec<usize>>,
    /// names of the states of each chain
    pub names: Option<Vec<Vec<String>>>,
}

impl ChainRequest {
    /// Whether these chains are what is asked for.
    pub(crate) fn is_met(&self, augmented: &AugmentedPlant<'_>, chains: &[Chain]) -> bool {
        let lengths = |asked: &Vec<usize>| chains.iter().map(Vec::len).eq(asked.iter().copied());
        let names = |asked: &Vec<Vec<String>>| *asked == named(augmented, chains);
        self.lengths.as_ref().is_none_or(lengths) && self.names.as_ref().is_none_or(names)
    }
}

/// Every assignment that gives the triangular form, the most balanced first
/// (of equally balanced ones, the one whose leading chain comes first).
///
/// # Errors
/// Where there is none: which equation breaks the form.
pub fn find(
    augmented: &AugmentedPlant<'_>,
    request: &ChainRequest,
) -> Result<Vec<Assignment>, Misfit> {
    let found = cuts(augmented, &heads(augmented)?)?;
    let (mut fits, other): (Vec<Assignment>, Vec<_>) = found
        .into_iter()
        .partition(|a| request.is_met(augmented, &a.chains));
    if fits.is_empty() {
        let allowed = other.iter().take(NAMED);
        let allowed = allowed.map(|a| named(augmented, &a.chains));
        return Err(Misfit::OtherChains(allowed.collect()));
    }
    fits.sort_by_key(|a| (imbalance(&a.chains), a.leading));
    fits.truncate(MOST);
    Ok(fits)
}

/// The measured states, in order.
pub(crate) fn heads(augmented: &AugmentedPlant<'_>) -> Result<Vec<usize>, Misfit> {
    let mut heads: Vec<usize> = vec![];
    for output in &augmented.outputs {
        let Some((state, ..)) = output.state else {
            return Err(Misfit::NoState {
                output: output.variable.name.clone(),
                expression: augmented.graph().render(output.variable.node, 60),
            });
        };
        if heads.contains(&state) {
            return Err(Misfit::MeasuredTwice(augmented.states[state].name.clone()));
        }
        heads.push(state);
    }
    Ok(heads)
}

/// The longest chain from `head` whose rows are all strict but the last, where some states are known, and the
/// new states in the last row: none or several.
pub(crate) fn grown(
    augmented: &AugmentedPlant<'_>,
    head: usize,
    is_known: impl Fn(usize) -> bool,
) -> (Chain, Vec<usize>) {
    let mut chain = vec![head];
    loop {
        let row = augmented.pattern[chain[chain.len() - 1]].iter().copied();
        let new: Vec<usize> = row
            .filter(|state| !chain.contains(state) && !is_known(*state))
            .collect();
        match new[..] {
            [next] => chain.push(next),
            _ => return (chain, new),
        }
    }
}

pub(crate) fn names(
    augmented: &AugmentedPlant<'_>,
    states: impl IntoIterator<Item = usize>,
) -> Vec<String> {
    let names = states.into_iter().map(|i| augmented.states[i].name.clone());
    names.collect()
}

/// Names of the states of each chain.
pub(crate) fn named<'c>(
    augmented: &AugmentedPlant<'_>,
    chains: impl IntoIterator<Item = &'c Chain>,
) -> Vec<Vec<String>> {
    let chains = chains.into_iter();
    chains
        .map(|chain| names(augmented, chain.iter().copied()))
        .collect()
}

/// Why a chain does not reach every state.
fn stuck(augmented: &AugmentedPlant<'_>, chain: &[usize], new: Vec<usize>) -> Misfit {
    let names = |states: Vec<usize>| names(augmented, states);
    let left = (0..augmented.states.len()).filter(|i| !chain.contains(i));
    match new.is_empty() {
        true => Misfit::ChainEnds {
            chain: names(chain.to_vec()),
            left: names(left.collect()),
        },
        false => Misfit::ChainBreaks {
            chain: names(chain.to_vec()),
            new: names(new),
        },
    }
}

/// Every cut into a leading chain and following ones; of one output its chain.
fn cuts(augmented: &AugmentedPlant<'_>, heads: &[usize]) -> Result<Vec<Assignment>, Misfit> {
    let grown = |&head: &usize| grown(augmented, head, |_| false);
    let paths: Vec<_> = heads.iter().map(grown).collect();
    let n = augmented.states.len();
    let mut found: Vec<Assignment> = vec![];
    let mut left = TRIED;
    for leading in 0..heads.len() {
        let lead = &paths[leading].0;
        for n1 in 1..=lead.len().min(n + 1 - heads.len()) {
            let others = paths.iter().enumerate().filter(|(i, _)| *i != leading);
            let mut cut = Cut {
                augmented,
                lead: &lead[..n1],
                taken: vec![false; n],
                following: others.map(|(_, (path, _))| path.as_slice()).collect(),
                chains: vec![],
                found: vec![],
                left,
            };
            cut.take(&lead[..n1]);
            cut.go();
            left = cut.left;
            for mut chains in cut.found {
                chains.insert(leading, lead[..n1].to_vec());
                match found.iter_mut().find(|a| a.chains == chains) {
                    Some(known) => known.leads.push(leading),
                    None => found.push(Assignment {
                        chains,
                        leading,
                        leads: vec![leading],
                    }),
                }
            }
        }
    }
    if found.is_empty() {
        let reasons = paths.into_iter();
        let reasons = reasons.map(|(chain, new)| stuck(augmented, &chain, new));
        let mut reasons: Vec<Misfit> = reasons.collect();
        return Err(match reasons.len() {
            1 => reasons.remove(0),
            _ => Misfit::NoCut(reasons),
        });
    }
    Ok(found)
}

/// Following chains behind a leading one, one after the other.
struct Cut<'a> {
    augmented: &'a AugmentedPlant<'a>,
    lead: &'a [usize],
    taken: Vec<bool>,
    /// the strict paths of their outputs
    following: Vec<&'a [usize]>,
    chains: Vec<Chain>,
    found: Vec<Vec<Chain>>,
    /// chains that may still be tried
    left: usize,
}

impl Cut<'_> {
    /// Takes states; false, and none is taken, where one is taken already.
    fn take(&mut self, states: &[usize]) -> bool {
        let is_free = states.iter().all(|&i| !self.taken[i]);
        if is_free {
            states.iter().for_each(|&i| self.taken[i] = true);
        }
        is_free
    }

    /// The next chain in every length that it can have, and those behind it.
    fn go(&mut self) {
        let rest = self.taken.iter().filter(|taken| !**taken).count();
        let Some(&path) = self.following.get(self.chains.len()) else {
            if rest == 0 {
                self.found.push(self.chains.clone());
            }
            return;
        };
        let behind = self.following.len() - self.chains.len() - 1;
        // the last one takes what is left, and each behind this one a state at least
        let (shortest, longest) = match behind {
            0 => (rest.max(1), rest),
            _ => (1, (path.len() + 1).min(rest.saturating_sub(behind))),
        };
        for length in shortest..=longest {
            if self.left == 0 {
                return;
            }
            self.left -= 1;
            let Some(states) = self.follower(path, length) else {
                continue;
            };
            if self.take(&states) {
                self.chains.push(states.clone());
                self.go();
                self.chains.pop();
                states.iter().for_each(|&i| self.taken[i] = false);
            }
        }
    }

    /// A following chain of n states: rows 1 … n−2 are strict, so that its first n−1 states are those of the
    /// strict path; row n−1 reads one more state, beside the leading chain.
    fn follower(&self, path: &[usize], n: usize) -> Option<Vec<usize>> {
        if n == 1 {
            return Some(vec![path[0]]);
        }
        let strict = path.get(..n - 1)?;
        let row = &self.augmented.pattern[strict[n - 2]];
        let mut new = row
            .iter()
            .copied()
            .filter(|i| !strict.contains(i) && !self.lead.contains(i));
        let last = new.next()?;
        new.next()
            .is_none()
            .then(|| strict.iter().copied().chain([last]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sensors;
    use lynkeus_model::{LoadOptions, Plant};

    fn with<T>(text: &str, unknown: &[&str], then: impl FnOnce(&AugmentedPlant<'_>) -> T) -> T {
        let plant = Plant::from_modelica(text, "p.mo", &LoadOptions::default()).unwrap();
        let unknown = unknown.iter().map(|s| s.to_string()).collect();
        let sensors = Sensors {
            unknown,
            ..Sensors::default()
        };
        then(&AugmentedPlant::new(&plant, &sensors).unwrap())
    }

    /// The chains, one behind the other.
    fn named(augmented: &AugmentedPlant<'_>, assignment: &Assignment) -> String {
        let chains = assignment.chains.iter();
        let chains = chains.map(|chain| names(augmented, chain.clone()).join(" "));
        chains.collect::<Vec<_>>().join(", ")
    }

    fn described(augmented: &AugmentedPlant<'_>) -> Vec<String> {
        let found = find(augmented, &ChainRequest::default()).unwrap();
        found.iter().map(|a| named(augmented, a)).collect()
    }

    /// States in any order: the chain comes from the equations.
    #[test]
    fn one_chain_with_an_unknown_input() {
        let text = "model T input Real pump; Real upper; Real lower; output Real level = lower;
          equation der(upper) = -sqrt(upper) + pump; der(lower) = sqrt(upper) - sqrt(lower); end T;";
        let chains = with(text, &["pump"], described);
        assert_eq!(chains, ["lower upper pump"]);
    }

    fn trays(n: usize, feed: usize) -> String {
        format!(
            "model C constant Integer n = {n}; constant Integer f = {feed}; input Real Zf; Real x[n];
             output Real top = x[1]; output Real bottom = x[n];
             equation
             der(x[1]) = x[2] - x[1];
             for i in 2:f-1 loop der(x[i]) = x[i-1] - 2*x[i] + x[i+1]; end for;
             der(x[f]) = x[f-1] - 3*x[f] + x[f+1] + Zf;
             for i in f+1:n-1 loop der(x[i]) = x[i-1] - 2*x[i] + x[i+1]; end for;
             der(x[n]) = x[n-1] - x[n]; end C;"
        )
    }

    /// The paper's column: x1 … x7 and x12 … x8, Zf; it can also be cut with the
    /// feed in the upper chain, which is less balanced.
    #[test]
    fn a_column_is_cut_at_its_most_balanced_place() {
        let chains = with(&trays(12, 8), &["Zf"], described);
        assert_eq!(
            chains[0],
            "x[1] x[2] x[3] x[4] x[5] x[6] x[7], x[12] x[11] x[10] x[9] x[8] Zf"
        );
        assert_eq!(chains.len(), 2, "{chains:?}");
        assert!(chains[1].ends_with("x[8] Zf, x[12] x[11] x[10] x[9]"));
    }

    #[test]
    fn lengths_and_names_decide_between_cuts() {
        with(&trays(12, 8), &["Zf"], |augmented| {
            let lengths = ChainRequest {
                lengths: Some(vec![9, 4]),
                names: None,
            };
            assert_eq!(find(augmented, &lengths).unwrap()[0].lengths(), [9, 4]);
            let wrong = ChainRequest {
                lengths: Some(vec![5, 8]),
                names: None,
            };
            let why = find(augmented, &wrong).unwrap_err();
            assert!(matches!(why, Misfit::OtherChains(allowed) if allowed.len() == 2));
        });
    }

    #[test]
    fn what_breaks_the_form_is_said() {
        let unreached = "model U Real a; Real b; output Real y = a;
          equation der(a) = -a; der(b) = a; end U;";
        let why = with(unreached, &[], |e| {
            find(e, &ChainRequest::default()).unwrap_err()
        });
        assert!(matches!(why, Misfit::ChainEnds { left, .. } if left == ["b"]));
        let two = "model U Real a; Real b; Real c; output Real y = a;
          equation der(a) = b + c; der(b) = a; der(c) = b; end U;";
        let why = with(two, &[], |e| find(e, &ChainRequest::default()).unwrap_err());
        let [chain, new] =
            [&["a"][..], &["b", "c"]].map(|of| of.iter().map(|&s| s.to_owned()).collect());
        assert_eq!(why, Misfit::ChainBreaks { chain, new });
    }

    /// Three sensors: the chain of a may be read before the others' ends, those of b and c not.
    #[test]
    fn more_chains_follow_one() {
        let text = |row: &str| {
            format!(
                "model M Real a1; Real a2; Real b1; Real b2; Real b3; Real c1;
                 output Real y = a1; output Real z = b1; output Real w = c1;
                 equation der(a1) = a2; der(a2) = -a1; der(b1) = b2; der(b2) = {row};
                 der(b3) = -c1*a1*b1; der(c1) = -c1; end M;"
            )
        };
        with(&text("b3 + a2"), &[], |augmented| {
            let found = find(augmented, &ChainRequest::default()).unwrap();
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!(named(augmented, &found[0]), "a1 a2, b1 b2 b3, c1");
            assert_eq!((found[0].leading, &found[0].leads), (0, &vec![0]));
        });
        let leads = with(&text("b3"), &[], |augmented| {
            find(augmented, &ChainRequest::default()).unwrap()[0]
                .leads
                .clone()
        });
        assert_eq!(leads, [0, 1, 2]);
        // it would have to follow two
        let refused = with(&text("b3 + a2 + c1"), &[], |augmented| {
            find(augmented, &ChainRequest::default()).unwrap_err()
        });
        assert!(matches!(refused, Misfit::NoCut(why) if why.len() == 3));
    }

    #[test]
    fn two_measured_states_need_no_chain_between_them() {
        let text = "model M Real a; Real b; output Real y = a; output Real z = b;
          equation der(a) = b; der(b) = -a*b; end M;";
        assert_eq!(with(text, &[], described), ["a, b"]);
    }
}
