// Colours of figures, light and dark, safe for colour-blind eyes. Figures name a colour; what it is on paper or on a
// dark screen is decided where they are drawn.

export type Theme = "light" | "dark";

interface Look {
  paper: string;
  ink: string;
  faint: string;
  rule: string;
  force: string;
  quasiStatic: string;
  fit: string;
  ice: string;
  glacier: string;
  water: string;
  bad: string;
  /** Of things beside each other that have no order, such as ensembles. */
  set1: string;
  set2: string;
  set3: string;
  set4: string;
  set5: string;
  set6: string;
}

/** A colour by its purpose. */
export type ColourName = keyof Look;

/** Okabe and Ito's blue and vermilion for the two estimates of the force, darker or lighter as contrast asks. */
export const LOOKS: Record<Theme, Look> = {
  light: {
    paper: "#ffffff",
    ink: "#16202a",
    faint: "#51606e",
    rule: "#c6d0d9",
    force: "#0b5f8a",
    quasiStatic: "#b35900",
    fit: "#16202a",
    ice: "#5aa7cc",
    glacier: "#9fb4c4",
    water: "#2b6ea0",
    bad: "#a3200d",
    set1: "#0b5f8a",
    set2: "#b35900",
    set3: "#00755a",
    set4: "#9c4a86",
    set5: "#7a6a00",
    set6: "#16202a",
  },
  dark: {
    paper: "#17202a",
    ink: "#e6edf3",
    faint: "#a3b1be",
    rule: "#3a4754",
    force: "#7cc4ea",
    quasiStatic: "#f0a24b",
    fit: "#e6edf3",
    ice: "#7cc4ea",
    glacier: "#6b7f90",
    water: "#6fa8d6",
    bad: "#ff9d8a",
    set1: "#7cc4ea",
    set2: "#f0a24b",
    set3: "#4fc9a4",
    set4: "#e0a3cf",
    set5: "#e3d24a",
    set6: "#e6edf3",
  },
};

/** Viridis (van der Walt and Smith, 2015), every sixteenth colour. */
const VIRIDIS = [
  "#440154", "#481a6c", "#472f7d", "#414487", "#39568c", "#31688e", "#2a788e", "#23888e", "#1f988b", "#22a884",
  "#35b779", "#54c568", "#7ad151", "#a5db36", "#d2e21b", "#fde725",
];

/** Share of the scale that is left out where it would not stand out: yellow on paper, violet on the dark. */
const LEFT_OUT: Record<Theme, [number, number]> = { light: [0, 0.1], dark: [0.3, 0] };

/** The colour at a share from 0 to 1 of the scale. */
export function viridis(share: number, theme: Theme): string {
  const [low, high] = LEFT_OUT[theme];
  const clamped = Math.min(1, Math.max(0, Number.isFinite(share) ? share : 0));
  const place = (low + clamped * (1 - low - high)) * (VIRIDIS.length - 1);
  const first = Math.min(VIRIDIS.length - 2, Math.floor(place));
  const [a, b] = [parse(VIRIDIS[first]), parse(VIRIDIS[first + 1])];
  const mixed = a.map((channel, i) => Math.round(channel + (place - first) * ((b[i] ?? 0) - channel)));
  return `#${mixed.map((channel) => channel.toString(16).padStart(2, "0")).join("")}`;
}

const parse = (hex = "#000000"): number[] => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
