//! Counts.

use std::collections::BTreeMap;

use super::case::Kind;

/// What was seen of one kind of case.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    pub plants: usize,
    pub designs: usize,
    /// the family fits, every condition proved
    pub fits: usize,
    pub open_fits: usize,
    pub misfits: usize,
    /// certificates by verdict
    pub proved: usize,
    pub undecided: usize,
    pub refuted: usize,
    /// proofs of which a trajectory was followed for at least one time constant
    pub followed: usize,
    /// proofs for samples that were attacked
    pub sampled: usize,
    /// proofs that take the slopes as they are together
    pub together: usize,
    /// the same of proofs for samples
    pub sampled_together: usize,
    /// tubes that were attacked, and those of them that stay in the box
    pub tubes: usize,
    pub stay: usize,
    /// tubes of errors that were attacked, and those of them that are proved to their end
    pub errors: usize,
    pub bounded: usize,
    /// bounds with a probability of which runs were counted
    pub probable: usize,
    /// cases with a violation
    pub violated: usize,
    /// refutations re-evaluated, and those found wrong
    pub refutations: usize,
    pub wrong: usize,
    /// refutations of conditions that are not re-evaluated
    pub unread: usize,
}

impl Counts {
    pub fn add(&mut self, other: &Self) {
        self.plants += other.plants;
        self.designs += other.designs;
        self.fits += other.fits;
        self.open_fits += other.open_fits;
        self.misfits += other.misfits;
        self.proved += other.proved;
        self.undecided += other.undecided;
        self.refuted += other.refuted;
        self.followed += other.followed;
        self.sampled += other.sampled;
        self.together += other.together;
        self.sampled_together += other.sampled_together;
        self.tubes += other.tubes;
        self.stay += other.stay;
        self.errors += other.errors;
        self.bounded += other.bounded;
        self.probable += other.probable;
        self.violated += other.violated;
        self.refutations += other.refutations;
        self.wrong += other.wrong;
        self.unread += other.unread;
    }
}

/// Counts per kind of case.
#[derive(Clone, Debug, Default)]
pub struct Tally(pub BTreeMap<Kind, Counts>);

impl Tally {
    pub fn add(&mut self, kind: Kind, counts: &Counts) {
        self.0.entry(kind).or_default().add(counts);
    }

    pub fn total(&self) -> Counts {
        let mut total = Counts::default();
        self.0.values().for_each(|counts| total.add(counts));
        total
    }

    /// A table in Markdown.
    pub fn table(&self) -> String {
        let mut text = "| | plants | observers | fits | proved | undecided | refuted | followed | of samples | together | samples together | tubes | that stay | errors | to their end | in probability | violated | witnesses checked | wrong |\n\
                        |---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
        let rows = self.0.iter().map(|(kind, counts)| (kind.word(), counts));
        let total = self.total();
        for (name, c) in rows.chain([("all", &total)]) {
            let numbers = [
                c.plants,
                c.designs,
                c.fits,
                c.proved,
                c.undecided,
                c.refuted,
                c.followed,
                c.sampled,
                c.together,
                c.sampled_together,
                c.tubes,
                c.stay,
                c.errors,
                c.bounded,
                c.probable,
                c.violated,
                c.refutations,
                c.wrong,
            ];
            let cells = numbers.map(|n| n.to_string()).join(" | ");
            text += &format!("| {name} | {cells} |\n");
        }
        text
    }
}
