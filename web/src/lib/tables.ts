// Which tables an ensemble has, and the line of Python that reads each.

export interface Table {
  file: string;
  /** The same in another format. */
  also?: string;
  meaning: string;
  /** With URL in place of the address. */
  read: string;
}

interface Options {
  sensitivities?: boolean | null;
  discrete_roots?: boolean | null;
}

const parquet = (name: string): string => `${name} = pd.read_parquet(URL)`;

/** The tables of an ensemble of a regime. */
export function tables(regime: string, options: Options): Table[] {
  const list: Table[] = [
    { file: "runs.parquet", also: "runs.csv", meaning: "one row per run: parameters and results", read: parquet("runs") },
  ];
  const isState = regime !== "fold_curve";
  if (isState) {
    list.push({ file: "profiles.parquet", meaning: "speed, thickness, fluidity and μ_w along the mélange", read: parquet("profiles") });
  }
  if (regime === "transient") {
    list.push({ file: "series.parquet", meaning: "time series of each run", read: parquet("series") });
  }
  if (regime === "branch" || regime === "fold_curve") {
    list.push({ file: "branches.parquet", also: "branches.csv", meaning: "points, folds, roots and ends", read: parquet("branches") });
  }
  if (regime === "calibration") {
    list.push({ file: "calibrations.parquet", also: "calibrations.csv", meaning: "estimates, residuals, samples", read: parquet("calibrations") });
  }
  if (options.sensitivities) {
    list.push({ file: "sensitivities.parquet", also: "sensitivities.csv", meaning: "derivatives by every parameter", read: parquet("sensitivities") });
  }
  if (options.discrete_roots) {
    list.push({ file: "roots.parquet", also: "roots.csv", meaning: "other steady states of the same discrete problem", read: parquet("roots") });
  }
  if (isState) list.push({ file: "ensemble.nc", meaning: "all of it as NetCDF", read: 'ensemble = xr.open_dataset(urllib.request.urlretrieve(URL, "ensemble.nc")[0])' });
  return list;
}
