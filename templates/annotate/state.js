// What is said of a video: {hazards, no_hazard}. Each function gives a new state.
export const EMPTY = { hazards: [], no_hazard: false };

export const only = ({ hazards, no_hazard }) => ({ hazards: hazards.map((hazard) => ({ ...hazard })), no_hazard });

function freeId(hazards) {
  const taken = new Set(hazards.map((hazard) => hazard.hazard_id));
  let number = 1;
  while (taken.has(`h${number}`)) number += 1;
  return `h${number}`;
}

// With one more hazard: of a track, over its frames, or of none.
export function added(state, track) {
  const hazard = {
    hazard_id: freeId(state.hazards),
    label: "",
    description: "",
    track_id: track ? track.track_id : null,
    first_frame: track ? track.first_frame : null,
    last_frame: track ? track.last_frame : null,
  };
  return { hazards: [...state.hazards, hazard], no_hazard: false };
}

// With a copy of another's hazard.
export function copied(state, hazard) {
  return { hazards: [...state.hazards, { ...hazard, hazard_id: freeId(state.hazards) }], no_hazard: false };
}

export function without(state, hazardId) {
  return { ...state, hazards: state.hazards.filter((hazard) => hazard.hazard_id !== hazardId) };
}

export function changed(state, hazardId, field, value) {
  const change = (hazard) => (hazard.hazard_id === hazardId ? { ...hazard, [field]: value } : hazard);
  return { hazards: state.hazards.map(change), no_hazard: false };
}

export const isSaid = (state) => state.no_hazard || state.hazards.length > 0;
