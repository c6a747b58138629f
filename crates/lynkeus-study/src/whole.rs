//! A study with every text that it is made from.

use std::path::Path;

use super::Study;
use lynkeus_answer::Error;
use lynkeus_table::files::read_text;

/// A study that goes without its files from here on.
#[derive(Clone, Debug)]
pub struct Whole {
    /// The study, with the plant's text.
    pub study: Study,
    /// The study's own text; empty where a model stands for it.
    pub text: String,
}

impl Whole {
    /// Reads a study, or a model that stands for one, as [`Study::load_or_bare`] does, and the plant's
    /// file. Where that cannot be found the study has no text of it: whoever asks for the plant is
    /// told.
    ///
    /// # Errors
    /// As [`Study::load`], of both files.
    pub fn load(path: impl AsRef<Path>, model: Option<String>) -> Result<Self, Error> {
        let path = path.as_ref();
        let (mut study, text) = match Study::bare(path) {
            Some(study) => (study, String::new()),
            None => {
                let text = read_text(path, "study")?;
                (Study::of_file(&text, path)?, text)
            }
        };
        study.model = model.or(study.model);
        if let Some(plant) = study.plant.as_deref().filter(|plant| plant.is_file()) {
            study.plant_text = Some(read_text(plant, "plant")?.into());
        }
        Ok(Self { study, text })
    }
}
