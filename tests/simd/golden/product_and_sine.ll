target triple = "x86_64-unknown-linux-gnu"
define internal void @segment0(ptr noalias nocapture readonly %arguments, i64 %first, ptr noalias nocapture %kept) {
entry:
  %a0 = getelementptr inbounds i64, ptr %arguments, i64 1
  %b0 = load ptr, ptr %a0
  %s0_ = getelementptr inbounds i64, ptr %arguments, i64 2
  %s0 = load i64, ptr %s0_
  %o0 = mul i64 %first, %s0
  %p0_0 = getelementptr inbounds i8, ptr %b0, i64 %o0
  %p0_1 = getelementptr inbounds i8, ptr %p0_0, i64 %s0
  %a1 = getelementptr inbounds i64, ptr %arguments, i64 3
  %b1 = load ptr, ptr %a1
  %s1_ = getelementptr inbounds i64, ptr %arguments, i64 4
  %s1 = load i64, ptr %s1_
  %o1 = mul i64 %first, %s1
  %p1_0 = getelementptr inbounds i8, ptr %b1, i64 %o1
  %p1_1 = getelementptr inbounds i8, ptr %p1_0, i64 %s1
  %v1 = load <2 x double>, ptr %p0_0, align 8
  %v2 = load <2 x double>, ptr %p0_1, align 8
  %v3 = shufflevector <2 x double> %v1, <2 x double> %v2, <2 x i32> <i32 0, i32 2>
  %v4 = shufflevector <2 x double> %v1, <2 x double> %v2, <2 x i32> <i32 1, i32 3>
  %v5 = call <2 x double> @llvm.fabs.v2f64(<2 x double> %v3)
  %v6 = fcmp ogt <2 x double> %v5, splat (double 0x40F86A0000000000)
  %v7 = or <2 x i1> zeroinitializer, %v6
  %v8 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v5, <2 x double> splat (double 0x3FE45F306DC9C883), <2 x double> splat (double 0x4338000000000000))
  %v9 = bitcast <2 x double> %v8 to <2 x i64>
  %v10 = fsub <2 x double> %v8, splat (double 0x4338000000000000)
  %v11 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v10, <2 x double> splat (double 0xBFF921FB54442D18), <2 x double> %v5)
  %v12 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v10, <2 x double> splat (double 0xBC91A62633145C07), <2 x double> %v11)
  %v13 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v10, <2 x double> splat (double 0x391F1976B7ED8FBC), <2 x double> %v12)
  %v14 = fmul <2 x double> %v13, %v13
  %v15 = call <2 x double> @llvm.fma.v2f64(<2 x double> splat (double 0x3DE5D8FA31EAA9E0), <2 x double> %v14, <2 x double> splat (double 0xBE5AE5E59F595795))
  %v16 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v15, <2 x double> %v14, <2 x double> splat (double 0x3EC71DE3567125EC))
  %v17 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v16, <2 x double> %v14, <2 x double> splat (double 0xBF2A01A019BFD181))
  %v18 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v17, <2 x double> %v14, <2 x double> splat (double 0x3F8111111110F7CA))
  %v19 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v18, <2 x double> %v14, <2 x double> splat (double 0xBFC5555555555548))
  %v20 = fmul <2 x double> %v14, %v13
  %v21 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v19, <2 x double> %v20, <2 x double> %v13)
  %v22 = call <2 x double> @llvm.fma.v2f64(<2 x double> splat (double 0xBDA8FA465DD74BCA), <2 x double> %v14, <2 x double> splat (double 0x3E21EE9D7526EF7C))
  %v23 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v22, <2 x double> %v14, <2 x double> splat (double 0xBE927E4F7EA3760B))
  %v24 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v23, <2 x double> %v14, <2 x double> splat (double 0x3EFA01A019C8390A))
  %v25 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v24, <2 x double> %v14, <2 x double> splat (double 0xBF56C16C16C14F8A))
  %v26 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v25, <2 x double> %v14, <2 x double> splat (double 0x3FA555555555554B))
  %v27 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v26, <2 x double> %v14, <2 x double> splat (double 0xBFE0000000000000))
  %v28 = call <2 x double> @llvm.fma.v2f64(<2 x double> %v27, <2 x double> %v14, <2 x double> splat (double 0x3FF0000000000000))
  %v29 = shl <2 x i64> %v9, splat (i64 63)
  %v30 = icmp slt <2 x i64> %v29, zeroinitializer
  %v31 = select <2 x i1> %v30, <2 x double> %v28, <2 x double> %v21
  %v32 = select <2 x i1> %v30, <2 x double> %v21, <2 x double> %v28
  %v33 = add <2 x i64> %v9, splat (i64 1)
  %v34 = bitcast <2 x double> %v3 to <2 x i64>
  %v35 = shl <2 x i64> %v9, splat (i64 62)
  %v36 = xor <2 x i64> %v35, %v34
  %v37 = shl <2 x i64> %v33, splat (i64 62)
  %v38 = and <2 x i64> %v36, splat (i64 -9223372036854775808)
  %v39 = bitcast <2 x double> %v31 to <2 x i64>
  %v40 = xor <2 x i64> %v39, %v38
  %v41 = bitcast <2 x i64> %v40 to <2 x double>
  %v42 = and <2 x i64> %v37, splat (i64 -9223372036854775808)
  %v43 = bitcast <2 x double> %v32 to <2 x i64>
  %v44 = xor <2 x i64> %v43, %v42
  %v45 = bitcast <2 x i64> %v44 to <2 x double>
  %v46 = bitcast <2 x i1> %v7 to i2
  %v47 = icmp ne i2 %v46, 0
  br label %near48
near48:
  br i1 %v47, label %far49, label %trig50, !prof !0
far49:
  %v51 = call <2 x double> @beyond_limit_sin(<2 x double> %v3, <2 x double> %v41)
  %v52 = call <2 x double> @beyond_limit_cos(<2 x double> %v3, <2 x double> %v45)
  br label %trig50
trig50:
  %v53 = phi <2 x double> [%v41, %near48], [%v51, %far49]
  %v54 = phi <2 x double> [%v45, %near48], [%v52, %far49]
  %v55 = fmul <2 x double> %v3, %v4
  %v56 = fadd <2 x double> %v55, %v53
  %v57 = shufflevector <2 x double> %v56, <2 x double> poison, <1 x i32> <i32 0>
  store <1 x double> %v57, ptr %p1_0, align 8
  %v58 = shufflevector <2 x double> %v56, <2 x double> poison, <1 x i32> <i32 1>
  store <1 x double> %v58, ptr %p1_1, align 8
  ret void
}
define void @kernel(ptr noalias nocapture readonly %arguments) {
entry:
  %kept = alloca [1 x <2 x double>], align 64
  %n = load i64, ptr %arguments
  %last = sub i64 %n, 2
  br label %group
group:
  %i = phi i64 [0, %entry], [%next, %group]
  %late = icmp sgt i64 %i, %last
  %first = select i1 %late, i64 %last, i64 %i
  call void @segment0(ptr %arguments, i64 %first, ptr %kept)
  %next = add i64 %i, 2
  %more = icmp slt i64 %next, %n
  br i1 %more, label %group, label %done
done:
  ret void
}
define internal <2 x double> @beyond_limit_sin(<2 x double> %x, <2 x double> %near) cold noinline {
  %v1 = extractelement <2 x double> %x, i32 0
  %v2 = call double @sin(double %v1)
  %v3 = call double @llvm.fabs.f64(double %v1)
  %v4 = fcmp ogt double %v3, 0x40F86A0000000000
  %v5 = extractelement <2 x double> %near, i32 0
  %v6 = select i1 %v4, double %v2, double %v5
  %v7 = insertelement <2 x double> %near, double %v6, i32 0
  %v8 = extractelement <2 x double> %x, i32 1
  %v9 = call double @sin(double %v8)
  %v10 = call double @llvm.fabs.f64(double %v8)
  %v11 = fcmp ogt double %v10, 0x40F86A0000000000
  %v12 = extractelement <2 x double> %v7, i32 1
  %v13 = select i1 %v11, double %v9, double %v12
  %v14 = insertelement <2 x double> %v7, double %v13, i32 1
  ret <2 x double> %v14
}
define internal <2 x double> @beyond_limit_cos(<2 x double> %x, <2 x double> %near) cold noinline {
  %v1 = extractelement <2 x double> %x, i32 0
  %v2 = call double @cos(double %v1)
  %v3 = call double @llvm.fabs.f64(double %v1)
  %v4 = fcmp ogt double %v3, 0x40F86A0000000000
  %v5 = extractelement <2 x double> %near, i32 0
  %v6 = select i1 %v4, double %v2, double %v5
  %v7 = insertelement <2 x double> %near, double %v6, i32 0
  %v8 = extractelement <2 x double> %x, i32 1
  %v9 = call double @cos(double %v8)
  %v10 = call double @llvm.fabs.f64(double %v8)
  %v11 = fcmp ogt double %v10, 0x40F86A0000000000
  %v12 = extractelement <2 x double> %v7, i32 1
  %v13 = select i1 %v11, double %v9, double %v12
  %v14 = insertelement <2 x double> %v7, double %v13, i32 1
  ret <2 x double> %v14
}
declare <2 x double> @llvm.fabs.v2f64(<2 x double>)
declare <2 x double> @llvm.fma.v2f64(<2 x double>, <2 x double>, <2 x double>)
declare <2 x double> @llvm.sqrt.v2f64(<2 x double>)
declare double @llvm.fabs.f64(double)
declare double @sin(double)
declare double @cos(double)
!0 = !{!"branch_weights", i32 1, i32 100000}
declare void @llvm.prefetch.p0(ptr, i32, i32, i32)
