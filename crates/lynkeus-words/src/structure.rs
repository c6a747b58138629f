//! What is found in the structure of a plant.

use lynkeus_structure::Reason;

use crate::Words;

impl Words for Reason {
    fn words(&self) -> String {
        self.text()
    }
}
