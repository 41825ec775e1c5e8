// An ensemble of the comparison.
import type { Sweep } from "../../api";
import type { Columns, LawGroup } from "../../api/analysis";

export interface Entry {
  sweep: Sweep;
  law: LawGroup | undefined;
  /** Why there is no law. */
  problem: string | undefined;
  /** Its runs, once they are there. */
  runs: Columns | undefined;
}
