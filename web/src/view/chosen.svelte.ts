// The runs of an ensemble that a panel draws: those that the address names, or else some, evenly spread over what
// colours them; with the table that they are chosen from.
import * as api from "../api";
import { type Columns, columns } from "../api/analysis";
import { readRuns, spread, stage, varied } from "../lib/choice";
import { Loaded, dependsOn } from "./loaded.svelte";
import { route } from "./route.svelte";

export class Chosen {
  readonly rows = new Loaded<Columns>();
  #sweep: () => api.Sweep;
  #usual: number;
  #most: number;
  #statuses: string[];

  /** `usual` runs are drawn where the address names none, up to `most` else; `statuses`: those that can be drawn. */
  constructor(sweep: () => api.Sweep, usual: number, most: number, statuses: string[]) {
    this.#sweep = sweep;
    this.#usual = usual;
    this.#most = most;
    this.#statuses = statuses;
    $effect(() => {
      dependsOn(this.look);
      const [at, query] = [this.id, { names: this.names, filter: this.filter }];
      if (this.look > 0) this.rows.ask(() => columns(at, query));
    });
  }

  readonly id = $derived.by(() => this.#sweep().id);
  readonly ended = $derived.by(() => api.ended(this.#sweep()));
  readonly look = $derived.by(() => stage(this.ended, this.#sweep().counts.total, api.isOver(this.#sweep().state)));
  readonly #varied = $derived.by(() => varied(this.#sweep()).join(","));
  readonly varied = $derived.by(() => this.#varied.split(",").filter((name) => name !== ""));
  readonly color = $derived(route.query["color"] ?? this.varied[0] ?? "");
  readonly filter = $derived(route.query["filter"]);
  readonly names = $derived([...new Set([...this.varied, this.color, "length_m"])].filter((name) => name !== "").join(","));
  readonly named = $derived(readRuns(route.query["runs"]));
  /** Runs of the table. */
  readonly indices = $derived((this.rows.value?.columns["run_index"] ?? []) as number[]);
  /** Those that can be drawn. */
  readonly candidates = $derived.by(() =>
    this.indices.flatMap((index, row) => {
      const status = String(this.rows.value?.columns["status"]?.[row]);
      return this.#statuses.includes(status) ? [{ index, value: this.#at(row) }] : [];
    }),
  );
  readonly drawn = $derived.by(() =>
    this.named.length > 0 ? this.named.slice(0, this.#most) : spread(this.candidates, this.#usual),
  );
  /** The same as a text: it changes only when they do. */
  readonly key = $derived(this.drawn.join(","));

  #at(row: number): number | null {
    const value = this.rows.value?.columns[this.color]?.[row];
    return typeof value === "number" ? value : null;
  }

  /** What colours a run. */
  value(index: number): number | null {
    return this.#at(this.indices.indexOf(index));
  }

  /** Draws these, or evenly again. */
  choose(runs: number[]): void {
    route.set({ runs: runs.length > 0 ? runs.join(",") : undefined });
  }
}
