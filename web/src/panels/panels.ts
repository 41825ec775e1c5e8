// The panels of an ensemble by their names in the address. Each is fetched when it is wanted.
import type { Component } from "svelte";
import type * as api from "../api";

export interface PanelProps {
  sweep: api.Sweep;
  dictionary: api.Dictionary;
  me: api.Me;
}

export interface Panel {
  name: string;
  load: () => Promise<{ default: Component<PanelProps> }>;
}

export const PANELS: Record<string, Panel> = {
  overview: { name: "Overview", load: () => import("./OverviewPanel.svelte") },
  laws: { name: "Laws", load: () => import("./LawPanel.svelte") },
  profiles: { name: "Profiles", load: () => import("./ProfilesPanel.svelte") },
  seasons: { name: "Seasons", load: () => import("./SeasonsPanel.svelte") },
  sensitivity: { name: "Sensitivity", load: () => import("./SensitivityPanel.svelte") },
  stability: { name: "Stability", load: () => import("./StabilityPanel.svelte") },
};
