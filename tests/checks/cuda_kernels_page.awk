# SPDX-License-Identifier: Apache-2.0
# The report of cuda_kernels.sh as a page in Markdown: a line for each kernel, a column for each generation of GPUs.
{
  name = $0
  for (i = 1; i <= 7; ++i) sub(/^[^ ]+ /, "", name)
  how = name
  sub(/<.*/, "", how)
  sub(/^[a-z_]*</, "", name); sub(/>$/, "", name); gsub(/detail::/, "", name); gsub(/unsigned int/, "uint32", name)
  if (!(name in threads)) names[++count] = name
  threads[name] = $3; shared[name] = $5; launched[name] = how
  cell[name, $1] = $4 " / " $2
  if ($6 + $7 > 0) cell[name, $1] = cell[name, $1] " **local " $6 + $7 "**"
  if (!(how SUBSEP $1 in lowest) || $2 < lowest[how, $1]) lowest[how, $1] = $2
}
function table(how, title,   n, line, rule, i, g) {
  print "## " title "\n"
  line = "| kernel | threads | shared |"; rule = "|---|---|---|"
  for (g = 1; g <= num_generations; ++g) { line = line " sm_" sm[g] " |"; rule = rule "---|" }
  print line "\n" rule
  for (i = count; i >= 1; --i) {  # ptxas works from the last kernel of a file to its first
    n = names[i]
    if (launched[n] != how) continue
    line = "| `" n "` | " threads[n] " | " shared[n] " |"
    for (g = 1; g <= num_generations; ++g) line = line " " cell[n, sm[g]] " |"
    print line
  }
  print ""
}
END {
  num_generations = split(generations, sm, " ")
  print "# What the kernels need on a GPU\n"
  print "Compiled by nvcc " version " from the PTX of `tests/cuda/all_kernels.cu`, that for sm_75 and that for sm_80 and later;"
  print "occupancy by NVIDIA's `cuda_occupancy.h`. Nothing here was measured on a GPU. Written by\n"
  print "```sh"
  print "bash tests/checks/cuda_kernels.sh $(command -v nvcc) g++ build/kernels /usr/include/eigen3 docs/cuda_kernels.md"
  print "```\n"
  print "Cells are registers of a thread / percent of a multiprocessor's threads that can run at once; shared memory is in bytes a"
  print "block. No kernel spills or has a stack frame: rows of `PerThread` and the K largest of `KLargest<K>` are registers, for"
  print "every K. The CTest `cuda.kernels` fails when one spills, falls under " least " %, or is not in the list.\n"
  table("run_blocks", "Blocks of warps: `launch`")
  table("run_lanes", "One thread an element: `for_each_lanes`")
  table("run_elements", "One thread an element: `for_each_n`")
}
