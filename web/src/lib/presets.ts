// Sweeps to begin with: those behind the figures of Amundson et al. (2025), and designs of one's own.
import type { Doc } from "./spec";

export interface Preset {
  key: string;
  name: string;
  doc: Doc;
}

const MELT = "melt_rate_m_per_day";
const SPEED = ["terminus_velocity_m_per_a", "calving_rate_m_per_a"];
const year = (mean: number, amplitude: number): Doc => ({ sinusoid: { mean, amplitude, period_a: 1, phase_a: 0 } });
const seasons: Doc = { duration_a: 3, fixed_dt_a: 0.01, profiles_at_a: [2, 2.25, 2.5, 2.75, 3] };

export const PRESETS: Preset[] = [
  {
    key: "melt",
    name: "Fig. 5: melt rate",
    doc: { name: "Melt sweep (Fig. 5)", regime: "steady", axes: [{ parameter: MELT, linspace: [0.5, 1, 51] }] },
  },
  {
    key: "rheology",
    name: "Fig. 3: rheology, one change at a time",
    doc: {
      name: "Rheology (Fig. 3)",
      regime: "steady",
      table: {
        columns: ["mu_s", "d_m", "b", "A"],
        rows: [[0.3, 25, 1e4, 0.5], [0.2, 25, 1e4, 0.5], [0.3, 10, 1e4, 0.5], [0.3, 25, 5e4, 0.5], [0.3, 25, 1e4, 5]],
      },
    },
  },
  {
    key: "size",
    name: "Fig. 4: size of the glacier",
    doc: {
      name: "Glacier size (Fig. 4)",
      regime: "steady",
      parameters: { [MELT]: 0.8 },
      axes: [
        {
          zip: [
            ...SPEED.map((parameter) => ({ parameter, values: [6000, 7000, 8000] })),
            { parameter: "terminus_thickness_m", values: [600, 700, 800] },
            { parameter: "width_m", values: [4000, 5000, 6000] },
          ],
        },
      ],
    },
  },
  {
    key: "width",
    name: "Fig. 6a, b: width of the fjord",
    doc: { name: "Fjord width (Fig. 6)", regime: "steady", axes: [{ parameter: "width_m", linspace: [3000, 7000, 5] }] },
  },
  {
    key: "gradient",
    name: "Fig. 6c, d: gradient of the width",
    doc: { name: "Width gradient (Fig. 6)", regime: "steady", axes: [{ parameter: "width_gradient", linspace: [-0.04, 0.04, 5] }] },
  },
  {
    key: "melt-season",
    name: "Fig. 7a, b: seasons of melt",
    doc: {
      name: "Seasons of melt about 0.7 m/d (Fig. 7)",
      regime: "transient",
      parameters: { [MELT]: 0.7 },
      start: "steady",
      time: seasons,
      forcing: { [MELT]: year(0.7, 0.2) },
      options: { lagged: true },
    },
  },
  {
    key: "calving-season",
    name: "Fig. 7c, d: seasons of calving",
    doc: {
      name: "Seasons of calving (Fig. 7)",
      regime: "transient",
      start: "steady",
      time: seasons,
      forcing: { calving_rate_m_per_a: year(6000, 600) },
      options: { lagged: true },
      axes: [{ parameter: MELT, values: [0.6, 0.7, 0.8] }],
    },
  },
  {
    key: "at-rest",
    name: "Fig. 2: at rest, without calving and melt",
    doc: {
      name: "Mélange at rest (Fig. 2)",
      regime: "quasi_static",
      length_m: 12000,
      axes: [{ parameter: "width_m", linspace: [3000, 7000, 5] }],
    },
  },
  {
    key: "branch",
    name: "Branch of steady states over the melt rate",
    doc: {
      name: "Branch over the melt rate",
      regime: "branch",
      melt_shape: "linear",
      parameters: { [MELT]: 0.35, width_m: 5600, n_cells: 20 },
      branch: { control: MELT, from: 0.1, to: 0.5 },
    },
  },
  {
    key: "saltelli",
    name: "Saltelli design for Sobol indices",
    doc: {
      name: "Sobol indices of the rheology",
      regime: "steady",
      parameters: { n_cells: 20 },
      sample: { method: "saltelli", n: 128, seed: 1, ranges: { b: { log: [1e4, 1e5] }, d_m: [15, 40], mu_s: [0.2, 0.35] } },
    },
  },
];
