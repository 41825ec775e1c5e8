// The runs of an ensemble that a panel draws: those that the address names, or else some, evenly spread over what
// colours them; with the table that they are chosen from.
import * as api from "../api";
import { type Columns, columns } from "../api/analysis";
import { exampleOf, readRuns, spread, stage, varied } from "../lib/choice";
import { Loaded, dependsOn } from "./loaded.svelte";
import { route } from "./route.svelte";

export class Chosen {
  readonly rows = new Loaded<Columns>();
  #sweep: () => api.Sweep;
  #usual: () => number;
  #most: number;
  #statuses: string[];
  /** What the page chose last, and of what: while runs come in, it stays. */
  #before: { of: string; runs: number[] } = { of: "", runs: [] };

  /** `usual` runs are drawn where the address names none, up to `most` else; `statuses`: those that can be drawn. */
  constructor(sweep: () => api.Sweep, usual: () => number, most: number, statuses: string[]) {
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
  readonly total = $derived.by(() => this.#sweep().counts.total);
  readonly ended = $derived.by(() => api.ended(this.#sweep()));
  readonly isOver = $derived.by(() => api.isOver(this.#sweep().state));
  readonly look = $derived.by(() => stage(this.ended, this.total, this.isOver));
  readonly #varied = $derived.by(() => varied(this.#sweep()).join(","));
  readonly varied = $derived.by(() => this.#varied.split(",").filter((name) => name !== ""));
  readonly color = $derived(route.query["color"] ?? this.varied[0] ?? "");
  readonly filter = $derived(route.query["filter"]);
  readonly names = $derived([...new Set([...this.varied, this.color, "length_m"])].filter((name) => name !== "").join(","));
  readonly #asked = $derived(readRuns(route.query["runs"]));
  /** Runs that the address names, and those of them that there are not. */
  readonly named = $derived(this.#asked.filter((run) => run < this.total));
  readonly absent = $derived(this.#asked.filter((run) => run >= this.total));
  readonly isNamed = $derived(this.#asked.length > 0);
  /** Runs of the table. */
  readonly indices = $derived((this.rows.value?.columns["run_index"] ?? []) as number[]);
  readonly #design = $derived.by(() => {
    const { columns: table = {} } = this.rows.value ?? {};
    const others = this.varied.filter((name) => name !== this.color);
    return this.indices.map((index, row) => ({
      index,
      value: this.#at(row),
      others: others.map((name) => table[name]?.[row]),
      isDrawn: this.#statuses.includes(String(table["status"]?.[row])),
    }));
  });
  /** Those that can be drawn. */
  readonly candidates = $derived(this.#design.filter((run) => run.isDrawn));
  /** A condition that some of the runs meet. */
  readonly example = $derived(exampleOf(this.rows.value?.columns ?? {}, this.varied, this.color));
  readonly drawn = $derived.by(() => (this.isNamed ? this.named.slice(0, this.#most) : this.#spread()));
  /** The same as a text: it changes only when they do. */
  readonly key = $derived(this.drawn.join(","));

  #spread(): number[] {
    const of = [this.id, this.color, this.filter, this.#usual()].join();
    const before = this.isOver || this.#before.of !== of ? [] : this.#before.runs;
    const runs = spread(this.#design, this.#usual(), before);
    this.#before = { of, runs };
    return runs;
  }

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
