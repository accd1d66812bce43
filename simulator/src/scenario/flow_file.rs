use std::path::Path;
use std::sync::Arc;

use toml::de::{DeTable, DeValue};

use super::sweep::quoted;
use crate::Model;
use crate::model::Flow;
use crate::model::flow_field::FlowField;

/// Makes the path of the flow's file absolute, since each point has its own directory.
pub(super) fn with_absolute_path(mut text: String, directory: &Path) -> String {
    let found = DeTable::parse(&text).ok().and_then(|file| {
        let DeValue::Table(flow) = file.get_ref().get("flow")?.get_ref() else { return None };
        let name = flow.get("file")?;
        let path = std::path::absolute(directory.join(name.get_ref().as_str()?)).ok()?;
        Some((name.span(), quoted(path.to_str()?)))
    });
    if let Some((span, path)) = found {
        text.replace_range(span, &path);
    }
    text
}

/// Shares the memory of equal fields.
pub(super) fn share_flow_field(model: &mut Model, known: &mut Vec<Arc<FlowField>>) {
    let Some(Flow::Field(field)) = &mut model.flow else { return };
    match known.iter().find(|known| *known == field) {
        Some(known) => *field = known.clone(),
        None => known.push(field.clone()),
    }
}
