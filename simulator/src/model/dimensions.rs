use crate::model::boundary::Axis;
use crate::model::receiver::ReceiverKind;
use crate::model::transmitter::Shape;
use crate::model::{Flow, Model};

impl Model {
    pub(crate) fn beyond_dimensions(&self) -> Option<String> {
        let dimensions = self.boundary.dimensions();
        if dimensions == 3 {
            return None;
        }
        let fault = |what: String| Some(format!("a run of dimensions = {dimensions} has no {what}"));
        if (0..3).any(|k| (self.boundary.axes[k] == Axis::Frozen) != (k >= dimensions)) || dimensions == 0 {
            return Some("the frozen axes must be z, or y and z".to_owned());
        }
        if self.boundary.vessel.is_some_and(|vessel| dimensions == 1 || vessel.along != Some(2)) {
            return fault(
                "vessel of this kind; make it a box, or in two dimensions a cylinder along z".to_owned(),
            );
        }
        let leaves = |v: [f64; 3]| v[dimensions..].iter().any(|&c| c != 0.0);
        let plug = match &self.flow {
            Some(Flow::Plug(velocity)) => *velocity,
            Some(Flow::Field(field)) => field.fastest(),
            Some(Flow::Poiseuille { .. }) => return fault("Poiseuille flow; make it a plug".to_owned()),
            None => [0.0; 3],
        };
        let species = self.species.iter().map(|species| (&species.name, species.drift));
        let transmitters = self.transmitters.iter().map(|one| (&one.name, one.center.map(f64::from)));
        let centers = self.receivers.iter().map(|one| (&one.name, one.center.map(f64::from)));
        let velocities = self.receivers.iter().map(|one| (&one.name, one.velocity));
        let (flow, all) =
            ("the flow".to_owned(), species.chain(transmitters).chain(centers).chain(velocities));
        if let Some((name, v)) = all.chain([(&flow, plug)]).find(|&(_, v)| leaves(v)) {
            return fault(format!(
                "room for the vector {v:?} of {name}; set the coordinates of absent dimensions to 0"
            ));
        }
        let binds = |kind: &ReceiverKind| matches!(kind, ReceiverKind::Receptors(_));
        if let Some(receiver) = self.receivers.iter().find(|receiver| binds(&receiver.kind)) {
            let name = &receiver.name;
            return fault(format!(
                "receptors, whose binding rates are in µm³/s; make {name} a partial receiver with a rate"
            ));
        }
        let fits = |shape: Shape| match shape {
            Shape::Cylinder(along, ..) => dimensions == 2 && along == 2,
            Shape::Lattice(_, sites) => sites[dimensions..].iter().all(|&count| count == 1),
            _ => true,
        };
        let transmitter = self.transmitters.iter().find(|transmitter| !fits(transmitter.shape))?;
        let name = &transmitter.name;
        fault(format!(
            "shape like that of {name}; make it a box or a ball, or a lattice with one place along absent dimensions"
        ))
    }
}
