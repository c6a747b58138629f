//! The pictures of the documentation, drawn by the tool from the studies that the repository ships.
pub fn draw() -> Result<(), String> {
    Ok(())
}
