//! From the study to its plant.

use lynkeus_model::{LoadOptions, Plant};

use super::Study;
use crate::Error;

impl Study {
    /// Loads the plant this study names, with the study's parameter values.
    ///
    /// # Errors
    /// The study names no plant, the file is missing, or the model is refused; a refusal of the
    /// model quotes its source line.
    pub fn load_plant(&self) -> Result<Plant, Error> {
        let Some(path) = &self.plant else {
            return Err(Error::input("the study names no plant")
                .at(&self.file)
                .hint("add a line such as plant = \"tank.mo\""));
        };
        let options = LoadOptions {
            model: self.model.clone(),
            parameters: self.parameters.clone(),
            symbolic_parameters: false,
        };
        crate::files::must_exist(path, "plant", &self.file)?;
        Plant::load(path, &options).map_err(|e| Error::input(e.to_string()))
    }
}
