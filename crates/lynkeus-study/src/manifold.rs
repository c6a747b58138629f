//! `[manifold]`: what is an angle, what a rotation.

use super::Name;
use super::keys::MANIFOLD;
use super::section::Entry;
use lynkeus_answer::Error;

/// States and outputs that live elsewhere than among the real numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ManifoldSettings {
    /// Angles in radians: states and outputs.
    pub circles: Vec<Name>,
    /// Unit quaternions: arrays of four states, the scalar first.
    pub quaternions: Vec<Name>,
}

impl ManifoldSettings {
    /// Whether it says anything.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.circles.is_empty() && self.quaternions.is_empty()
    }
}

pub(super) fn read(entry: Entry<'_>) -> Result<ManifoldSettings, Error> {
    let mut section = entry.section("[manifold]", &MANIFOLD)?;
    let mut names = |key: &str| {
        let names = section.optional(key, |e| e.list_of(Entry::name))?;
        Ok::<_, Error>(names.unwrap_or_default())
    };
    Ok(ManifoldSettings {
        circles: names("circle")?,
        quaternions: names("quaternion")?,
    })
}
